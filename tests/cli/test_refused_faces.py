"""What the command line says where recordings or key poses teach no head, no eyes and no expression: one line each."""

import json
import sys

import pytest
from click.testing import CliRunner
from corpora import twin_corpus
from nodding import nodding, nodding_corpus

from facesynth.cli import main
from facesynth.cli.train import train
from facesynth.methods.registry import create
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid


@pytest.fixture
def refused(monkeypatch, capsys, tmp_path):
    """The one line of an error of `facesynth ARGUMENTS`, run in this process in an empty folder."""

    def run(*arguments):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["facesynth", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
        lines = capsys.readouterr().err.strip().splitlines()
        assert left.value.code == 2
        assert len(lines) == 1, lines
        return lines[0].removeprefix("error: ")

    return run


@pytest.fixture(scope="module")
def headless(tmp_path_factory):
    """Recordings with neither head nor eyes."""
    return nodding_corpus(tmp_path_factory.mktemp("headless") / "corpus", 3, heads=0).path


@pytest.mark.parametrize(
    ("method", "wanted"),
    [("head_knn", "has a head pose"), ("head_hmm", "has a head pose"), ("eyes", "has no recording with eyes (gaze and lids)")],
)
def test_a_corpus_without_head_or_gaze(refused, headless, tmp_path, method, wanted):
    assert wanted in refused("train", method, headless, "-o", tmp_path / "m.safetensors")
    assert not (tmp_path / "m.safetensors").exists()


@pytest.mark.parametrize("method", ["head_knn", "head_hmm"])
def test_fewer_than_two_takes_of_a_head(refused, tmp_path, method):
    corpus = nodding_corpus(tmp_path / "one", 1)
    assert "at least 2 are needed to learn from" in refused("train", method, corpus.path, "-o", tmp_path / "m.safetensors")


@pytest.mark.parametrize(
    ("emotions", "wanted"),
    [
        (("neutral",), "was recorded in neutral alone; record the same sentences in another emotion too"),
        (("happy",), "has no neutral recordings"),
    ],
)
def test_a_single_emotion(refused, tmp_path, emotions, wanted):
    corpus = twin_corpus(tmp_path / "one", emotions, sentences=3)
    assert wanted in refused("train", "expression", corpus.path, "-o", tmp_path / "m.safetensors")


def test_recordings_of_one_emotion_alone_are_learned_from_where_there_are_any(refused, tmp_path):
    corpus, path = twin_corpus(tmp_path / "twins", ("neutral", "happy"), sentences=3), tmp_path / "m.safetensors"
    done = CliRunner().invoke(train, ["phone_mean", str(corpus.path), "--emotion", "happy", "--json", "-o", str(path)])
    assert json.loads(done.output)["utterances"] == len(corpus) / 2
    wanted = "unknown emotion of a recording 'hapy'; did you mean happy?"
    assert wanted in refused("train", "phone_mean", corpus.path, "--emotion", "hapy", "-o", path)
    assert "learns from all of them" in refused("train", "emotion", corpus.path, "--emotion", "happy", "-o", path)


def test_an_emotion_without_its_neutral_twin(refused, tmp_path):
    corpus = twin_corpus(tmp_path / "twins", ("neutral", "happy"), sentences=4)
    lines = (corpus.path / "utterances.csv").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if ("_happy" in line.split(",")[0]) == ("s00" in line) or line == lines[0]]
    (corpus.path / "utterances.csv").write_text("\n".join(kept) + "\n", encoding="utf-8")
    told = refused("train", "expression", corpus.path, "-o", tmp_path / "m.safetensors")
    assert "happy has 0 sentences that were recorded in neutral too" in told


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """A mouth, a head and two seconds of speech."""
    folder = tmp_path_factory.mktemp("heads")
    corpus = nodding_corpus(folder / "actor", 4)
    create("phone_mean").fit(corpus).save(folder / "mouth.safetensors")
    create("head_knn", near=0.2, rough=0.5, away=0.3).fit(corpus).save(folder / "head.safetensors")
    speech, _ = nodding(100)
    save_wav(folder / "line.wav", speech.audio, speech.sample_rate)
    write_textgrid(folder / "line.TextGrid", speech.phones)
    return folder


@pytest.mark.parametrize(
    ("lines", "wanted"),
    [
        (("0,0,0,0", "1.5,5,0,0", "1,0,5,0"), "line 4: 1 s is not later than the line before (1.5 s); sort the lines"),
        (("0,0,0,0", "2.5,5,0,0"), "line 3: 2.5 s is outside of the speech, 0 to 2.000 s"),
    ],
)
def test_key_poses_out_of_order_or_beyond_the_end(refused, shop, tmp_path, lines, wanted):
    keys = tmp_path / "keys.csv"
    keys.write_text("\n".join(["time_s,pitch,yaw,roll", *lines]) + "\n", encoding="utf-8")
    spoken = ("speak", shop / "mouth.safetensors", shop / "line.wav", "--phones", shop / "line.TextGrid")
    assert wanted in refused(*spoken, "--head", shop / "head.safetensors", "--head-keys", keys, "-o", tmp_path / "out.npz")
    assert not (tmp_path / "out.npz").exists()
