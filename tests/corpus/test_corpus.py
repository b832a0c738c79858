import json
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
from corpora import EMOTIONS, tiny_corpus, tiny_layout, tiny_utterances

from facesynth.corpus import Corpus, Record
from facesynth.corpus.signals import fit_length
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, Speech

ABOUT = {"performer": "Åsa B.", "layout": tiny_layout(), "fps": 60, "emotions": EMOTIONS}


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("shared") / "tiny")


@pytest.fixture
def corpus(shared, tmp_path):
    return Corpus.open(shutil.copytree(shared.path, tmp_path / "tiny"))


def contents(path) -> dict[str, bytes]:
    return {str(file.relative_to(path)): file.read_bytes() for file in sorted(path.rglob("*")) if file.is_file()}


def test_everything_comes_back(shared):
    corpus = Corpus.open(shared.path)
    assert len(corpus) == len(corpus.ids) == 12
    assert (corpus.performer, corpus.fps, corpus.emotions, corpus.synthetic) == ("Tiny", 120, EMOTIONS, True)
    assert corpus.layout == tiny_layout()
    for record, speech, motion in tiny_utterances():
        utterance = corpus[record.id]
        assert replace(corpus.record(record.id), source_hash="") == record
        assert (utterance.sentence, utterance.take, utterance.emotion) == (record.sentence, record.take, record.emotion)
        assert utterance.speech.phones.labels == speech.phones.labels
        np.testing.assert_allclose(utterance.speech.phones.ends_s, speech.phones.ends_s, atol=1e-6)
        assert utterance.speech.sample_rate == speech.sample_rate
        np.testing.assert_allclose(utterance.speech.audio, speech.audio, atol=2**-15)
        for name in ("frames", "head", "eyes"):
            np.testing.assert_array_equal(getattr(utterance.motion, name), getattr(motion, name))


def test_the_same_corpus_is_the_same_bytes(shared, tmp_path):
    assert contents(tiny_corpus(tmp_path / "again").path) == contents(shared.path)


def test_arrays_are_the_utterances_in_order(shared):
    arrays = shared.arrays()
    assert arrays.ids == shared.ids
    for utterance, start, stop in zip(shared, arrays.range_starts, arrays.range_stops, strict=True):
        np.testing.assert_array_equal(arrays.frames[start:stop], utterance.motion.frames)
    assert arrays.range_stops[-1] == len(arrays.frames)
    empty = shared.subset([]).arrays()
    assert (empty.frames.shape, empty.range_starts.shape, empty.range_stops.shape) == ((0, 42), (0,), (0,))


def test_motion_is_as_long_as_the_phones_and_short_gaps_are_filled(tmp_path):
    corpus = Corpus.create(tmp_path / "c", **{**ABOUT, "fps": 120})
    record, speech, motion = tiny_utterances(1)[0]
    frames = motion.frames.copy()
    frames[30:38] = frames[60:90, :3] = np.nan
    corpus.add_utterance(record, speech, replace(motion, frames=frames[:-15], head=motion.head[:-15], eyes=motion.eyes[:-15]))
    utterance, report = corpus.read(record.id)
    assert len(utterance.motion) == speech.phones.frame_bounds(120)[-1] == len(motion)
    assert not np.isnan(utterance.motion.frames[30:38]).any()
    assert np.isnan(utterance.motion.frames[60:90, :3]).all()
    np.testing.assert_array_equal(utterance.motion.frames[-15:-3], np.tile(frames[-16], (12, 1)))
    assert np.isnan(utterance.motion.frames[-3:]).all()
    assert (report.filled_samples, len(report.long_gaps)) == (8 * 14, 1)
    assert np.isnan(corpus.raw_motion(record.id).frames[30:38]).all()


def test_a_layout_with_numbers_of_numpy_can_be_kept(tmp_path):
    layout = Layout("markers", ("a", "b"), {"mouth": tuple(np.arange(2))}, ((np.int64(0), np.int64(1)),), tuple(np.arange(6.0)))
    Corpus.create(tmp_path / "c", **{**ABOUT, "layout": layout, "fps": np.float32(60)})
    kept = Corpus.open(tmp_path / "c")
    assert kept.layout == layout
    assert type(kept.layout.neutral[0]) is float


def test_fit_length_cuts():
    signal = np.arange(10, dtype=np.float32)[:, None]
    assert fit_length(signal, 7, 120).shape == (7, 1)
    assert fit_length(signal[:0], 7, 120).shape == (0, 1)


def test_names_may_be_of_any_script(tmp_path):
    corpus = Corpus.create(tmp_path / "Ein Ordner – 資料", **{**ABOUT, "fps": 120, "emotions": ("neutral", "fröhlich")})
    record, speech, motion = tiny_utterances(1)[0]
    record = replace(
        record, id="Übung 7 喜び", text="naïve, “ça” 喜び\nzwei", sentence="é", emotion="fröhlich", consent="yes, 同意"
    )
    speech = replace(speech, emotions=EmotionTrack.constant("fröhlich", speech.duration_s))
    kept = corpus.add_utterance(record, speech, motion, [("ça", 0.2, 0.5)])
    again = Corpus.open(corpus.path)
    assert again.performer == "Åsa B."
    assert again.record(record.id) == kept
    assert again[record.id].speech.text == record.text
    assert again[record.id].emotion == "fröhlich"


def test_emotion_that_moves_is_kept(tmp_path):
    corpus = Corpus.create(tmp_path / "c", **{**ABOUT, "fps": 120})
    record, speech, motion = tiny_utterances(1)[0]
    track = EmotionTrack(("neutral", "sad"), np.array([0.25, speech.duration_s]), np.array([1.0, 0.5]))
    corpus.add_utterance(record, replace(speech, emotions=track), motion)
    kept = Corpus.open(corpus.path)[record.id]
    assert kept.speech.emotions.labels == ("neutral", "sad")
    np.testing.assert_allclose(kept.speech.emotions.intensities, [1, 0.5])
    np.testing.assert_allclose(kept.speech.emotions.ends_s, track.ends_s, atol=1e-6)
    assert kept.emotion == "sad"


def test_unusable_utterances_are_listed_but_not_iterated(corpus):
    corpus.update(replace(corpus.record("s00_happy_t1"), usable=False, reason="the cat walked by"))
    again = Corpus.open(corpus.path)
    assert (len(again), len(again.records)) == (11, 12)
    assert "s00_happy_t1" not in [utterance.id for utterance in again]
    assert again["s00_happy_t1"].id == "s00_happy_t1"
    assert again.record("s00_happy_t1").reason == "the cat walked by"


def test_provenance_states_who_and_how_much(shared):
    facts = json.loads(json.dumps(shared.provenance()))
    assert facts["performer"] == "Tiny"
    assert facts["synthetic"] is True
    assert (facts["utterances"], facts["fps"]) == (12, 120)
    assert (facts["licences"], facts["consents"]) == (["CC0-1.0"], ["none needed"])
    assert facts["minutes"] == pytest.approx(sum(u.speech.duration_s for u in shared) / 60, abs=1e-3)


def test_the_hash_tells_what_matters_from_remarks(corpus):
    before = corpus.provenance()["sha256"]
    corpus.update(replace(corpus.record("s00_happy_t1"), reason="a remark"))
    assert Corpus.open(corpus.path).provenance()["sha256"] == before
    assert corpus.subset(corpus.ids[1:]).provenance()["sha256"] != before
    corpus.remove_node("s00_happy_t1:1")
    assert corpus.provenance()["sha256"] != before


def test_adding_again_changes_nothing_even_after_corrections(corpus):
    record, speech, motion = tiny_utterances(1)[0]
    grid = corpus.files.phones(record.id)
    grid.write_text(grid.read_text(encoding="utf-8").replace('"ow"', '"aa"'), encoding="utf-8")
    corpus.update(replace(corpus.record(record.id), text="corrected"))
    before = contents(corpus.path)
    assert corpus.add_utterance(record, speech, motion).text == "corrected"
    assert contents(corpus.path) == before


def test_a_lost_file_is_written_again(corpus):
    record, speech, motion = tiny_utterances(1)[0]
    corpus.files.motion(record.id).unlink()
    with pytest.raises(FacesynthError, match="missing"):
        corpus[record.id]
    corpus.add_utterance(record, speech, motion)
    assert len(corpus[record.id].motion) == len(motion)


@pytest.mark.parametrize("name", ["s00_neutral_t1", "S00_Neutral_T1"])
def test_another_recording_under_the_same_name_is_refused(corpus, name):
    _, speech, motion = tiny_utterances(2)[1]
    before = contents(corpus.path)
    with pytest.raises(FacesynthError, match="another recording"):
        corpus.add_utterance(Record(name, emotion="happy"), speech, motion)
    assert contents(corpus.path) == before


@pytest.mark.parametrize("interruption", [OSError("disk full"), KeyboardInterrupt()])
@pytest.mark.parametrize("at", range(5))
def test_an_interruption_at_any_write_loses_nothing(corpus, tmp_path, monkeypatch, at, interruption):
    """The files replaced are: sound, phones, motion, utterances.csv; the fifth never comes."""
    *_, (record, speech, motion) = tiny_utterances(13)
    before = contents(corpus.path)
    calls = iter(range(99))
    real = os.replace

    def failing(source, target):
        if next(calls) == at:
            raise interruption
        real(source, target)

    monkeypatch.setattr(os, "replace", failing)
    if at == 4:
        corpus.add_utterance(record, speech, motion)
    else:
        with pytest.raises(type(interruption)):
            corpus.add_utterance(record, speech, motion)
        monkeypatch.undo()
        after = contents(corpus.path)
        assert {name: after[name] for name in before} == before, "what was there is there"
        assert not [name for name in after if ".part-" in name], "nothing half-written"
        again = Corpus.open(corpus.path)
        assert again.ids == tuple(sorted(u[0].id for u in tiny_utterances(12)))
        again.add_utterance(record, speech, motion)
    monkeypatch.undo()
    assert contents(corpus.path) == contents(tiny_corpus(tmp_path / "whole", 13).path)


@pytest.mark.parametrize("at", range(2))
def test_an_interrupted_creation_can_be_repeated_or_opened(tmp_path, monkeypatch, at):
    calls = iter(range(99))
    real = os.replace
    monkeypatch.setattr(os, "replace", lambda a, b: (_ for _ in ()).throw(OSError) if next(calls) == at else real(a, b))
    with pytest.raises(OSError):  # noqa: PT011 - the injected one
        Corpus.create(tmp_path / "c", **ABOUT)
    monkeypatch.undo()
    if at == 0:
        Corpus.create(tmp_path / "c", **ABOUT)
    assert len(Corpus.open(tmp_path / "c")) == 0


def test_two_writers_do_not_lose_each_others_lines(corpus):
    first, second = Corpus.open(corpus.path), Corpus.open(corpus.path)
    extra = tiny_utterances(14)[12:]
    first.add_utterance(*extra[0])
    second.add_utterance(*extra[1])
    assert len(Corpus.open(corpus.path)) == 14


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"record": Record("x", emotion="furious")}, "unknown emotion 'furious'"),
        ({"fps": 60.0}, "runs at 60 fps"),
        ({"frames": np.full((4, 42), np.inf, np.float32)}, "infinite"),
        ({"frames": np.zeros((0, 42), np.float32)}, "empty"),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_written(corpus, change, message):
    record, speech, motion = tiny_utterances(1)[0]
    before = contents(corpus.path)
    fps, frames = change.get("fps", 120.0), change.get("frames", motion.frames)
    with pytest.raises(FacesynthError, match=message):
        corpus.add_utterance(change.get("record", replace(record, id="x")), speech, Motion(frames, fps, motion.layout))
    assert contents(corpus.path) == before


def test_unknown_phones_and_other_layouts_are_refused(corpus):
    record, speech, motion = tiny_utterances(1)[0]
    labels = ("xx", *speech.phones.labels[1:])
    strange = Speech(speech.audio, speech.sample_rate, replace(speech.phones, labels=labels), speech.emotions)
    with pytest.raises(FacesynthError, match="unknown phone 'xx'"):
        corpus.add_utterance(replace(record, id="x"), strange, motion)
    renamed = replace(motion.layout, names=("a", *motion.layout.names[1:]))
    with pytest.raises(FacesynthError, match="another layout"):
        corpus.add_utterance(replace(record, id="x"), speech, replace(motion, layout=renamed))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("corpus.yaml", "format: 99\n", "format 99"),
        ("corpus.yaml", "a: [", "YAML"),
        ("corpus.yaml", "- 1\n", "format None"),
        ("corpus.yaml", "format: 1\n", "'performer' is missing"),
        ("corpus.yaml", "format: 1\nperformer: A\nfps: fast\nemotions: [x]\nlayout: {}\n", "corpus.yaml"),
        ("corpus.yaml", "format: 1\nperformer: A\nfps: 60\nemotions: [x]\nlayout: {kind: markers, names: 3}\n", "corpus.yaml"),
        ("utterances.csv", "id,txt\na,b\n", "unknown column 'txt'"),
        ("utterances.csv", "id,text\na\n", "line 2.*number of cells"),
        ("utterances.csv", "id,take\na,two\n", "line 2.*two"),
        ("utterances.csv", "id\na\nA\n", "line 3.*twice"),
        ("utterances.csv", "id,usable\na,perhaps\n", "yes or no"),
        ("utterances.csv", "id,split\na,trian\n", "unknown split 'trian'"),
        ("utterances.csv", "id,intensity\na,2\n", "0 to 1"),
        ("utterances.csv", "id\n../../etc/passwd\n", "line 2.*'/'"),
    ],
)
def test_damaged_files_are_one_clear_error(corpus, name, content, message):
    (corpus.path / name).write_text(content, encoding="utf-8")
    with pytest.raises(FacesynthError, match=message):
        Corpus.open(corpus.path)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 not really", b"\x93NUMPY", b"garbage"])
def test_damaged_motion_is_one_clear_error(corpus, content):
    corpus.files.motion("s00_happy_t1").write_bytes(content)
    with pytest.raises(FacesynthError, match="not a motion file"):
        corpus["s00_happy_t1"]


def test_motion_of_objects_is_not_loaded(corpus):
    np.savez(corpus.files.motion("s00_happy_t1"), frames=np.array([[{}]], object))
    with pytest.raises(FacesynthError, match="not a motion file"):
        corpus["s00_happy_t1"]


def test_motion_of_another_rate_or_width_is_named(corpus):
    path = corpus.files.motion("s00_happy_t1")
    np.savez(path, frames=np.zeros((5, 42), np.float32), fps=30.0)
    with pytest.raises(FacesynthError, match="runs at 30 fps"):
        corpus["s00_happy_t1"]
    np.savez(path, frames=np.zeros((5, 41), np.float32))
    with pytest.raises(FacesynthError, match=r"\[T, 42\]"):
        corpus["s00_happy_t1"]
    np.savez(path, head=np.zeros((5, 6), np.float32))
    with pytest.raises(FacesynthError, match="no array 'frames'"):
        corpus["s00_happy_t1"]


def test_links_do_not_lead_out_of_the_corpus(corpus, tmp_path):
    outside = tmp_path / "secret.wav"
    outside.write_bytes(b"secret")
    path = corpus.path / "audio" / "s00_happy_t1.wav"
    path.unlink()
    path.symlink_to(outside)
    with pytest.raises(FacesynthError, match="leads out of the corpus"):
        corpus["s00_happy_t1"]
    shutil.rmtree(corpus.path / "motion")
    (corpus.path / "motion").symlink_to(tmp_path, target_is_directory=True)
    with pytest.raises(FacesynthError, match="leads out of the corpus"):
        corpus.raw_motion("s00_happy_t1")


def test_what_is_not_there_is_said(tmp_path, shared):
    with pytest.raises(FacesynthError, match="is no corpus"):
        Corpus.open(tmp_path)
    with pytest.raises(FacesynthError, match="s00_happy_t1"):
        shared["s00_hapy_t1"]
    with pytest.raises(FacesynthError, match="a corpus already"):
        Corpus.create(shared.path, **ABOUT)
    with pytest.raises(FacesynthError, match="emotions"):
        Corpus.create(tmp_path / "c", **{**ABOUT, "emotions": ("a", "a")})
    for emotion in ("Happy", "very sad", "a,b"):
        with pytest.raises(FacesynthError, match="one word in lower case"):
            Corpus.create(tmp_path / "c", **{**ABOUT, "emotions": ("neutral", emotion)})
    with pytest.raises(FacesynthError, match="fps"):
        Corpus.create(tmp_path / "c", **{**ABOUT, "fps": float("nan")})
    assert not (tmp_path / "c").exists()
