import numpy as np
import pytest
from acting import per_phone, vanish

from facesynth.corpus.checks.check import check
from facesynth.corpus.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import lip_gap
from facesynth.inference.phones import BILABIALS
from facesynth.performer import build, stage
from facesynth.performer import capture as stage_capture
from facesynth.performer.build import build_performer
from facesynth.performer.script import Sentence, load_script
from facesynth.performer.takes import takes_of
from facesynth.performer.truth import read_truth

SCRIPT = (Sentence(1, "Stop it right now!"), Sentence(2, "Maybe my mother was home."))


@pytest.fixture
def short_script(rig, voice, monkeypatch):
    monkeypatch.setattr(build, "load_script", lambda _: SCRIPT)


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.startswith(".")
    }


@pytest.fixture(scope="module")
def built(rig, voice, tmp_path_factory):
    """Two sentences, built in two processes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "load_script", lambda _: SCRIPT)
        return build_performer("small", path=tmp_path_factory.mktemp("built") / "performer", seed=3, workers=2)


def test_the_corpus_is_what_it_says(built):
    corpus = Corpus.open(built.path)
    assert corpus.synthetic
    assert corpus.performer == "synthetic-joe"
    assert "synthetic" in corpus.header.licence
    assert "synthetic" in corpus.header.consent
    assert (corpus.fps, len(corpus.layout.names)) == (120.0, 90)
    assert corpus.emotions == ("neutral", "happy", "angry", "sad")
    assert len(corpus) == len(corpus.records) == 4 + 12
    assert "s002_sad_t3" in corpus
    assert set(corpus.provenance()) >= {"performer", "synthetic"}


def test_sound_phones_and_motion_are_equally_long(built):
    for utterance in built:
        seconds = len(utterance.speech.audio) / utterance.speech.sample_rate
        assert utterance.speech.duration_s == pytest.approx(seconds, abs=0.01)
        assert utterance.motion.duration_s == pytest.approx(seconds, abs=0.01)
        assert {"p", "b", "m", "ay"} & set(utterance.speech.phones.labels)


def test_the_markers_close_on_every_bilabial(built):
    for utterance in built:
        gap = lip_gap(utterance.motion)
        smallest = [np.nanmin(frames) for frames in per_phone(gap, utterance.speech.phones, BILABIALS)]
        assert max(smallest) < 0.5


def test_one_process_or_two_give_the_same_bytes(built, short_script, tmp_path):
    build_performer("small", path=tmp_path / "again", seed=3, workers=1)
    assert contents(tmp_path / "again") == contents(built.path)


def test_an_interrupted_build_goes_on_to_the_same_bytes(built, short_script, tmp_path, monkeypatch):
    folder = tmp_path / "Unterbrochen – 2"
    add, done = Corpus.add_utterance, []

    def interrupted(self, *arguments):
        if len(done) == 7:
            raise KeyboardInterrupt
        done.append(arguments)
        return add(self, *arguments)

    monkeypatch.setattr(Corpus, "add_utterance", interrupted)
    with pytest.raises(KeyboardInterrupt):
        build_performer("small", path=folder, seed=3, workers=1)
    assert len(Corpus.open(folder)) == 7
    assert not set(Corpus.open(folder).ids) - set(read_truth(folder))
    monkeypatch.setattr(Corpus, "add_utterance", add)
    build_performer("small", path=folder, seed=3, workers=1)
    assert contents(folder) == contents(built.path)


def test_a_killed_worker_is_no_traceback(short_script, tmp_path, monkeypatch):
    monkeypatch.setattr(build, "record_takes", vanish)
    with pytest.raises(FacesynthError, match="what is done is kept"):
        build_performer("small", path=tmp_path / "c", workers=2)


def test_what_is_built_is_not_built_again(built, short_script, monkeypatch):
    monkeypatch.setattr(build, "speak", lambda _: pytest.fail("said again"))
    assert len(build_performer("small", path=built.path, seed=3)) == 16


def test_another_corpus_in_the_folder_is_left_alone(built, short_script):
    with pytest.raises(FacesynthError, match="another corpus"):
        build_performer("small", path=built.path, seed=4)


def test_gaps_are_as_the_truth_says(built):
    truth = read_truth(built.path)
    assert set(truth) == {record.id for record in built.records}
    for record in built.records:
        raw = built.raw_motion(record.id)
        missing = np.zeros(raw.points.shape[:2], bool)
        for fault in truth[record.id]:
            if fault.kind.endswith("gap"):
                missing[fault.start : fault.stop, raw.layout.names.index(fault.markers[0])] = True
        assert np.array_equal(np.isnan(raw.points).any(axis=-1), missing)


def test_a_take_that_cannot_be_aligned_stays_and_says_why(short_script, tmp_path, monkeypatch):
    from facesynth.speech import alignment

    def refuse(audio, rate, text):
        raise FacesynthError("the transcript does not match")

    monkeypatch.setattr(alignment, "align", refuse)
    monkeypatch.setattr(build, "load_script", lambda _: SCRIPT[:1])
    corpus = build_performer("small", path=tmp_path / "c", workers=1)
    assert len(corpus) == 0
    assert [record.usable for record in corpus.records] == [False] * 4
    assert all("does not match" in record.reason for record in corpus.records)


def test_a_clean_build_has_no_faults(short_script, tmp_path, monkeypatch):
    monkeypatch.setattr(build, "load_script", lambda _: SCRIPT[:1])
    corpus = build_performer("small", path=tmp_path / "c", workers=1, clean=True)
    assert not any(read_truth(corpus.path).values())
    assert all(np.isfinite(corpus.raw_motion(utterance).frames).all() for utterance in corpus.ids)


def test_the_corpus_check_finds_contaminated_takes(short_script, tmp_path, monkeypatch):
    monkeypatch.setattr(stage_capture, "CONTAMINATED_SHARE", 1.0)
    corpus = build_performer("small", path=tmp_path / "c", workers=1)
    contaminated = {take for take, faults in read_truth(corpus.path).items() if any(fault.phone is not None for fault in faults)}
    found = {record.id for problem in check(corpus) for record in corpus.records if record.id in problem.file}
    assert len(contaminated) == len(corpus)
    assert len(contaminated & found) >= 0.75 * len(contaminated)


def test_takes_are_split_by_sentence():
    takes = [take for sentence in load_script("full") for take in takes_of(sentence)]
    splits = {}
    for take in takes:
        splits.setdefault(take.sentence.name, set()).add(take.split)
    assert all(len(split) == 1 for split in splits.values())
    test = {name for name, split in splits.items() if split == {"test"}}
    thrice = {take.sentence.name for take in takes if take.number == 3}
    assert len(takes) == 4 * (225 + 2 * 23)
    assert len(thrice) == 23
    assert test & thrice
    assert 0.1 < len(test) / 225 < 0.25
    assert {take.split for sentence in load_script("small") for take in takes_of(sentence)} == {"train", "test"}


def test_every_take_has_seeds_of_its_own():
    takes = [take for sentence in load_script("small") for take in takes_of(sentence)]
    seeds = [seed for take in takes for seed in take.seeds(0)]
    assert len(set(seeds)) == len(seeds)
    assert takes[0].seeds(0) == takes[0].seeds(0) != takes[0].seeds(1)


def test_calm_speech_is_framed_by_silence(voice):
    calm = stage.calm_speech("Good morning.")
    assert (calm.pitch_hz[: round(0.3 / 0.005)] == 0).all()
    assert (calm.pitch_hz[-round(0.3 / 0.005) :] == 0).all()


@pytest.mark.parametrize(("options", "message"), [({"script": "large"}, "unknown script"), ({"workers": 0}, "1 or more")])
def test_wrong_arguments_are_refused(options, message):
    with pytest.raises(FacesynthError, match=message):
        build_performer(**options)
