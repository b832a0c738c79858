"""A method that hears the sound alone is asked for no phones: from the recordings to the spoken motion nothing is aligned."""

import csv
import json
from importlib import import_module

import numpy as np
import pytest
from click.testing import CliRunner
from corpora import tiny_layout, tiny_utterances

from facesynth.cli.corpus import corpus_group
from facesynth.cli.evaluate import evaluate
from facesynth.cli.speak import speak
from facesynth.cli.train import train
from facesynth.corpus import Corpus
from facesynth.evaluation import contestants
from facesynth.evaluation.contestants import references, without_phones
from facesynth.inference.errors import FacesynthError
from facesynth.inference.expectation import Said
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.registry import create, load
from facesynth.speech import phone_sources
from facesynth.speech.audio import save_wav

HEARING_ALONE = (("ridge",), ("lds",), ("network", "phones=false", "steps=1"))


def run(command, *arguments):
    return CliRunner().invoke(command, [str(one) for one in arguments], catch_exceptions=False)


@pytest.fixture(autouse=True)
def nothing_finds_phones(monkeypatch):
    def unasked(*_, **__):
        raise AssertionError("nobody asked for phones")

    for name in ("align", "_heard", "_in_english", "_in_another", "_transcribed"):
        monkeypatch.setattr(phone_sources, name, unasked)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    """Twelve recordings of sound and motion, as `corpus add --no-phones` takes them in."""
    session, folder = tmp_path_factory.mktemp("session"), tmp_path_factory.mktemp("corpus") / "actor"
    for number, (record, speech, motion) in enumerate(tiny_utterances(12, fps=30)):
        save_wav(session / f"{record.id}.wav", speech.audio, speech.sample_rate)
        np.savez(session / f"{record.id}.npz", frames=motion.frames, fps=30.0)
        if number == 0:
            (session / f"{record.id}.txt").write_text("what is said", encoding="utf-8")
    layout = tmp_path_factory.mktemp("layout") / "layout.json"
    layout.write_text(json.dumps(tiny_layout().to_dict()), encoding="utf-8")
    run(corpus_group, "new", folder, "--performer", "A", "--layout", layout, "--fps", 30)
    made = run(corpus_group, "add", folder, session, "--no-phones")
    assert "phones not looked for" in made.stdout
    return Corpus.open(folder)


def test_recordings_are_taken_in_with_their_words_and_without_phones(corpus):
    assert corpus.without_phones() == corpus.ids
    assert [record.text for record in corpus.records if record.text] == ["what is said"]
    phones = corpus[corpus.ids[0]].speech.phones
    assert (phones.labels, phones.known) == (("pau",), False)
    rows = list(csv.DictReader((corpus.path / "import.csv").read_text(encoding="utf-8").splitlines()))
    assert {row["phones"] for row in rows} == {"not looked for"}


def test_the_check_says_it_once_and_finds_nothing_grave(corpus):
    found = json.loads(run(corpus_group, "check", corpus.path, "--json").stdout)["problems"]
    said = [row for row in found if row["file"] == "phones"]
    assert len(said) == 1
    assert "nobody knows what is said in 12 recordings" in said[0]["what"]
    assert not any(row["grave"] for row in found)


@pytest.mark.parametrize("asked", HEARING_ALONE, ids=lambda asked: asked[0])
def test_it_is_trained_and_speaks(corpus, asked, tmp_path, monkeypatch):
    """What is heard is used where nobody speaks and at p, b and m; nobody is asked for words, and no file is written of it."""
    heard = phone_sources.FoundPhones(PhoneTrack(("p", "aa"), np.array([0.2, 0.5])), (), ("music is heard",), "listening")
    monkeypatch.setattr(phone_sources, "_listened", lambda *_: heard)
    model, sound = tmp_path / "m.safetensors", tmp_path / "line.wav"
    assert "--text" not in run(train, asked[0], corpus.path, *asked[1:], "-o", model).stdout
    speech = corpus[corpus.ids[1]].speech
    save_wav(sound, speech.audio, speech.sample_rate)
    told = run(speak, model, sound, "-o", tmp_path / "line.npz")
    assert "music is heard" in told.stderr
    assert "phones" not in told.stderr
    assert not (tmp_path / "line.TextGrid").exists()
    with np.load(tmp_path / "line.npz") as made:
        assert np.ptp(made["frames"], axis=0).max() > 0


@pytest.mark.parametrize("name", ["efase", "anime_graph", "phone_mean", "coarticulation", "network"])
def test_what_needs_phones_says_so_before_it_learns(corpus, name):
    with pytest.raises(FacesynthError, match="12 of 12 recordings"):
        create(name).fit(corpus)


def test_reference_rows_that_ask_for_phones_are_left_out_and_named(corpus, tmp_path, monkeypatch):
    kept, asking = without_phones(references(), corpus)
    assert set(asking) == {"phone mean", "viseme table"}
    assert {"mean face", "ridge", "tcn", "network by sound"} <= {one.label for one in kept}
    assert not any(one.create().needs_phones for one in kept)
    some = [one for one in references() if one.label in ("mean face", "phone mean")]
    import_module("facesynth.evaluation.report")  # it shall keep the real rows
    monkeypatch.setattr(contestants, "references", lambda *_: some)
    made = run(evaluate, corpus.path, "mean_face", "--folds", 2, "--test-limit", 2, "--no-video", "-o", tmp_path)
    assert "left out, for nobody knows what is said in all recordings: phone mean" in made.stderr
    assert "| mean face |" in made.stdout


def test_words_that_are_given_are_used(corpus, tmp_path, monkeypatch):
    found = phone_sources.FoundPhones(PhoneTrack(("p", "aa"), np.array([0.2, 0.5])), (), (), "transcript")
    monkeypatch.setattr(phone_sources, "_in_english", lambda *_: found)
    save_wav(tmp_path / "line.wav", np.random.default_rng(0).normal(0, 0.1, 8000).astype(np.float32), 16000)
    model = create("ridge").fit(corpus)
    model.save(tmp_path / "m.safetensors")
    run(speak, tmp_path / "m.safetensors", tmp_path / "line.wav", "--text", "pa", "-o", tmp_path / "line.npz")
    assert (tmp_path / "line.TextGrid").exists()


def test_emotions_that_change_are_heard_where_nobody_knows_the_phones():
    feelings = EmotionTrack(("neutral", "happy"), np.array([0.4, 1.0]), np.ones(2))
    speech = Speech(np.zeros(16000, np.float32), 16000, PhoneTrack.unknown(1.0), feelings)
    said = Said.of(speech, ("neutral", "happy"))
    assert said.ends_s.tolist() == [0.4, 1.0]
    assert said.emotions.tolist() == [[1, 0], [0, 1]]


def test_a_network_says_whether_it_needs_phones_exported_too(corpus, tmp_path):
    from facesynth.cli.export import export

    create("network", phones=False, steps=1).fit(corpus).save(tmp_path / "m.safetensors")
    run(export, tmp_path / "m.safetensors", "-o", tmp_path / "folder")
    from facesynth.methods.registry import load_trained

    assert not load(tmp_path / "m.safetensors").needs_phones
    assert not load_trained(tmp_path / "folder").needs_phones
    assert create("network").needs_phones
