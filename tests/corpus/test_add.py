import csv
import shutil

import numpy as np
import pytest
from corpora import EMOTIONS, label_lines, tiny_layout, tiny_utterances

from facesynth.corpus import Corpus
from facesynth.corpus.add.add import add, find_recordings
from facesynth.corpus.add.transcripts import read_transcripts
from facesynth.corpus.align import align
from facesynth.corpus.checks.check import check
from facesynth.inference.errors import FacesynthError
from facesynth.motion.pose import apply_head, rigid_points
from facesynth.speech.audio import load_audio, save_wav
from facesynth.speech.textgrid import write_textgrid

NEUTRAL = np.reshape(tiny_layout().neutral, (-1, 3))


def new_corpus(path) -> Corpus:
    return Corpus.create(path, performer="A", layout=tiny_layout(), fps=120, emotions=EMOTIONS, licence="CC0", consent="yes")


@pytest.fixture
def session(tmp_path):
    """A folder as a day of recording leaves it: head motion still in the markers, phones corrected in Praat."""
    folder = tmp_path / "Tag 1"
    for record, speech, motion in tiny_utterances(3):
        save_wav(folder / f"{record.id}.wav", speech.audio, speech.sample_rate)
        world = apply_head(motion.points, motion.head, NEUTRAL, rigid_points(motion.layout))
        np.savez(folder / f"{record.id}.npz", frames=world, fps=120.0)
        write_textgrid(folder / f"{record.id}.TextGrid", speech.phones)
        (folder / f"{record.id}.txt").write_text(record.text + "\n", encoding="utf-8")
    return folder


def contents(path) -> dict[str, bytes]:
    return {str(file.relative_to(path)): file.read_bytes() for file in sorted(path.rglob("*")) if file.is_file()}


def test_a_folder_in_one_go(session, tmp_path):
    corpus = new_corpus(tmp_path / "c")
    listed = {record.id: {"emotion": record.emotion, "take": record.take} for record, *_ in tiny_utterances(3)}
    report = add(corpus, [session], listed=listed)
    assert (len(report.added), report.unchanged, report.refused) == (3, (), {})
    for record, speech, motion in tiny_utterances(3):
        kept = corpus[record.id]
        assert (kept.emotion, kept.take, kept.speech.text) == (record.emotion, record.take, record.text)
        assert kept.speech.phones.labels == speech.phones.labels
        assert np.abs(kept.motion.frames - motion.frames).max() < 0.3
        assert np.abs(kept.motion.head - motion.head).max() < 0.3
        assert corpus.record(record.id).aligned_hash == "", "phones came from a person"


def test_again_changes_nothing(session, tmp_path):
    corpus = new_corpus(tmp_path / "c")
    add(corpus, [session])
    before = contents(corpus.path)
    report = add(Corpus.open(corpus.path), [session])
    assert (report.added, len(report.unchanged)) == ((), 3)
    assert contents(corpus.path) == before


def test_interrupted_and_repeated_gives_the_same_corpus(session, tmp_path, monkeypatch):
    whole = new_corpus(tmp_path / "whole")
    add(whole, [session])
    corpus = new_corpus(tmp_path / "c")
    real, calls = Corpus.add_utterance, iter(range(99))

    def interrupted(self, *args, **kwargs):
        if next(calls) == 1:
            raise KeyboardInterrupt
        return real(self, *args, **kwargs)

    monkeypatch.setattr(Corpus, "add_utterance", interrupted)
    with pytest.raises(KeyboardInterrupt):
        add(corpus, [session])
    assert len(Corpus.open(corpus.path)) == 1
    add(Corpus.open(corpus.path), [session])
    assert contents(corpus.path) == contents(whole.path)


def test_what_cannot_be_used_is_named_and_the_rest_added(session, tmp_path):
    (session / "s00_happy_t1.npz").write_bytes(b"damaged")
    (session / "s00_neutral_t1.npz").unlink()
    (session / "notes.docx").write_bytes(b"")
    (session / ".DS_Store").write_bytes(b"")
    (session / "lonely.csv").write_text("a\n", encoding="utf-8")
    shutil.copy(session / "s00_neutral_t2.wav", session / "con.wav")
    shutil.copy(session / "s00_neutral_t2.npz", session / "con.npz")
    report = add(new_corpus(tmp_path / "c"), [session])
    assert report.added == ("s00_neutral_t2",)
    assert "damaged" in report.refused["s00_happy_t1"]
    assert "no motion file" in report.refused["s00_neutral_t1"]
    assert "no sound file" in report.refused["lonely"]
    assert "neither sound, motion" in report.refused["notes.docx"]
    assert "device on Windows" in report.refused["con"]
    assert len(report.refused) == 5


def test_two_sounds_of_one_name_are_refused(session):
    shutil.copy(session / "s00_happy_t1.wav", session / "s00_happy_t1.flac")
    recordings, refused = find_recordings([session])
    assert len(recordings) == 2
    assert "2 files of sound" in refused["s00_happy_t1"]


def test_one_sound_and_one_motion_belong_together(session, tmp_path):
    record, speech, _ = tiny_utterances(1)[0]
    phones = tmp_path / "labels.txt"
    phones.write_text(label_lines(speech.phones))
    files = [session / f"{record.id}.wav", shutil.move(session / f"{record.id}.npz", tmp_path / "mocap 07.npz")]
    corpus = new_corpus(tmp_path / "c")
    report = add(corpus, files, {"id": "Übung", "text": "so so", "emotion": "happy", "take": 3}, phones=phones)
    assert report.added == ("Übung",)
    kept = corpus["Übung"]
    assert (kept.emotion, kept.take, kept.speech.text, kept.sentence) == ("happy", 3, "so so", "so so")
    assert kept.speech.phones.labels == speech.phones.labels


def test_emotion_that_moves_comes_with_the_recording(session, tmp_path):
    for path in session.glob("s00_neutral*"):
        path.unlink()
    (session / "s00_happy_t1.emotions.csv").write_text("end_s,emotion,intensity\n0.5,neutral,1\n9,sad,0.5\n", encoding="utf-8")
    corpus = new_corpus(tmp_path / "c")
    report = add(corpus, [session], {"emotion": "sad"})
    assert report.refused == {}
    assert corpus["s00_happy_t1"].speech.emotions.labels == ("neutral", "sad")


def test_words_of_a_textgrid_are_the_text(session, tmp_path):
    record, speech, _ = tiny_utterances(1)[0]
    write_textgrid(session / f"{record.id}.TextGrid", speech.phones, [("good", 0.2, 0.5), ("day", 0.5, 0.7)])
    (session / f"{record.id}.txt").unlink()
    corpus = new_corpus(tmp_path / "c")
    add(corpus, [session])
    assert corpus.record(record.id).text == "good day"


def test_a_word_file_beside_the_recording_is_the_text(session, tmp_path):
    record = tiny_utterances(1)[0][0]
    (session / f"{record.id}.txt").unlink()
    (session / f"{record.id}.align").write_text("0 2000 sil\n2000 9000 good\n9000 20000 day\n20000 21000 sp\n", encoding="utf-8")
    corpus = new_corpus(tmp_path / "c")
    add(corpus, [session])
    assert corpus.record(record.id).text == "good day"


def test_a_word_file_of_another_form_refuses_its_recording_alone(session, tmp_path):
    record = tiny_utterances(1)[0][0]
    (session / f"{record.id}.txt").unlink()
    (session / f"{record.id}.align").write_text("good day\n", encoding="utf-8")
    report = add(new_corpus(tmp_path / "c"), [session])
    assert "is not `start end word`" in report.refused[record.id]
    assert len(report.added) == 2


def test_real_speech_with_its_words_is_aligned_and_may_be_aligned_anew(recordings, tmp_path):
    sound = min(recordings("ravdess_speech").rglob("03-01-01-01-01-01-01.flac"))
    wave = 0.1 * np.sin(np.arange(600) / 7)[:, None, None]
    np.savez(tmp_path / "mocap.npz", frames=NEUTRAL + wave * np.arange(len(NEUTRAL))[:, None], head=np.zeros((600, 6)))
    corpus = new_corpus(tmp_path / "c")
    report = add(corpus, [sound, tmp_path / "mocap.npz"], {"text": "Kids are talking by the door."})
    assert report.refused == {}
    (utterance,) = corpus
    assert {"k", "ih", "d", "z", "t", "ao"} <= set(utterance.speech.phones.labels)
    assert len(utterance.motion) == round(utterance.speech.duration_s * 120)
    assert align(corpus).aligned == corpus.ids
    assert corpus[utterance.id].speech.phones.labels == utterance.speech.phones.labels


def test_an_emotion_that_the_corpus_lacks_is_refused_before_anything_is_heard(session, tmp_path):
    report = add(new_corpus(tmp_path / "c"), [session], {"emotion": "bored"})
    assert report.added == ()
    assert "emotion 'bored' is none of the corpus'" in report.refused["s00_happy_t1"]


def test_another_recording_of_the_same_name_from_another_folder_is_refused(session, tmp_path):
    corpus = new_corpus(tmp_path / "c")
    add(corpus, [session])
    before = contents(corpus.path / "motion")
    other = tmp_path / "Tag 2"
    other.mkdir()
    for suffix in (".wav", ".npz", ".TextGrid"):
        shutil.copy(session / f"s00_neutral_t2{suffix}", other / f"s00_happy_t1{suffix}")
    report = add(corpus, [other])
    assert "another recording called 's00_happy_t1'" in report.refused["s00_happy_t1"]
    assert contents(corpus.path / "motion") == before
    assert add(corpus, [other], replacing=True).changed["s00_happy_t1"] == ("motion", "phones", "sound")
    again = contents(corpus.path / "motion")
    assert again["s00_happy_t1.npz"] == again["s00_neutral_t2.npz"] != before["s00_happy_t1.npz"]


def test_what_fits_one_recording_is_refused_for_many(session, tmp_path):
    with pytest.raises(FacesynthError, match="fit one recording, but there are 3"):
        add(new_corpus(tmp_path / "c"), [session], {"text": "hello"})
    with pytest.raises(FacesynthError, match="no such file"):
        add(new_corpus(tmp_path / "d"), [tmp_path / "nowhere"])


def test_motion_that_lasts_otherwise_than_the_sound_is_told_or_refused(session, tmp_path):
    with np.load(session / "s00_happy_t1.npz") as stored:
        np.savez(session / "s00_happy_t1.npz", frames=stored["frames"][:-40], fps=120.0)
    with np.load(session / "s00_neutral_t1.npz") as stored:
        np.savez(session / "s00_neutral_t1.npz", frames=stored["frames"][: len(stored["frames"]) // 3], fps=120.0)
    report = add(new_corpus(tmp_path / "c"), [session])
    assert any("do they begin together?" in remark for remark in report.remarks["s00_happy_t1"])
    assert "are they of one recording" in report.refused["s00_neutral_t1"]
    assert report.added == ("s00_happy_t1", "s00_neutral_t2")


@pytest.mark.parametrize(("share", "is_used"), [(0.4, True), (0.6, False)])
def test_what_is_added_with_gaps_is_not_grave_for_the_check(session, tmp_path, share, is_used):
    for path in session.glob("*.npz"):
        with np.load(path) as stored:
            frames = stored["frames"].copy()
        frames[np.arange(len(frames)) % 100 < 100 * share] = np.nan
        np.savez(path, frames=frames, fps=120.0, head=np.zeros((len(frames), 6)))
    corpus = new_corpus(tmp_path / "c")
    report = add(corpus, [session])
    assert bool(report.added) == is_used
    if is_used:
        missing = [problem for problem in check(corpus) if "samples are missing" in problem.what]
        assert missing
        assert not any(problem.grave for problem in missing)
    else:
        assert "% of the motion's samples are missing" in report.refused["s00_happy_t1"]


def test_a_table_among_the_clips_says_what_is_said(session, tmp_path):
    for path in session.glob("*.txt"):
        path.unlink()
    table = session / "lines.csv"
    table.write_text("id,text\ns00_happy_t1.wav,good day\ns00_neutral_t1,so so\nnobody,never\n", encoding="utf-8")
    corpus = new_corpus(tmp_path / "c")
    report = add(corpus, [session])
    assert report.refused == {}
    assert [record.text for record in corpus.records] == ["good day", "so so", ""]
    assert report.remarks["lines.csv"] == ("says what is said in 2 recordings", "names 1 that are not here: nobody")
    other = new_corpus(tmp_path / "d")
    report = add(other, [session], texts={"s00_happy_t1": "other words"})
    assert other.record("s00_happy_t1").text == "other words"
    assert "came with --text-file" in report.refused["lines.csv"]
    assert add(new_corpus(tmp_path / "e"), [session], texts=read_transcripts(table)).refused == {}, "it is the same table"


def test_a_list_among_the_clips_is_passed_over_with_words(session, tmp_path):
    (session / "list.csv").write_text("id,emotion\ns00_happy_t1,happy\n", encoding="utf-8")
    report = add(new_corpus(tmp_path / "c"), [session])
    assert len(report.added) == 3
    assert "--list" in report.refused["list.csv"]


def test_the_account_says_what_was_used_and_what_not(session, tmp_path):
    (session / "s00_happy_t1.npz").write_bytes(b"damaged")
    corpus = new_corpus(tmp_path / "c")
    add(corpus, [session])
    with open(corpus.path / "import.csv", encoding="utf-8", newline="") as file:
        rows = {row["recording"]: row for row in csv.DictReader(file)}
    assert {name: row["used"] for name, row in rows.items()} == {
        "s00_happy_t1": "no",
        "s00_neutral_t1": "yes",
        "s00_neutral_t2": "yes",
    }
    assert rows["s00_happy_t1"]["why"].startswith("s00_happy_t1.npz is no")
    assert str(tmp_path) not in (corpus.path / "import.csv").read_text(encoding="utf-8"), "places of files are nobody's business"
    used = rows["s00_neutral_t2"]
    assert used["phones"] == "given"
    wanted = ["wav", "npz", "TextGrid", "txt"]
    assert used["files"] == "; ".join(f"Tag 1/s00_neutral_t2.{suffix}" for suffix in wanted)


def test_an_account_outlives_other_imports_and_damage(session, tmp_path):
    corpus = new_corpus(tmp_path / "c")
    (session / "s00_happy_t1.npz").unlink()
    add(corpus, [session])
    before = (corpus.path / "import.csv").read_bytes()
    one = [session / f"s00_neutral_t2.{suffix}" for suffix in ("wav", "npz", "TextGrid", "txt")]
    add(corpus, one)
    assert (corpus.path / "import.csv").read_bytes() == before
    (corpus.path / "import.csv").write_bytes(b"\xff\x00garbage")
    add(corpus, [session])
    assert (corpus.path / "import.csv").read_bytes() == before


def test_a_fault_of_the_program_ends_one_recording_alone(session, tmp_path, monkeypatch):
    from facesynth.corpus.add import prepare

    real = prepare.read_motion

    def failing(corpus, recording, face):
        if recording.name == "s00_happy_t1":
            raise ZeroDivisionError("of all things")
        return real(corpus, recording, face)

    monkeypatch.setattr(prepare, "read_motion", failing)
    report = add(new_corpus(tmp_path / "c"), [session])
    assert len(report.added) == 2
    assert "ZeroDivisionError" in report.refused["s00_happy_t1"]
    assert prepare.FAULT in report.refused["s00_happy_t1"]


def test_aligning_a_corpus_gives_what_adding_gave(recordings, tmp_path):
    """What is heard is what is kept: sixteen bits, so that aligning later gives the same to the byte."""
    folder = tmp_path / "session"
    folder.mkdir()
    words = {"01": "Kids are talking by the door.", "02": "Dogs are sitting by the door."}
    for sound in sorted(recordings("ravdess_speech").rglob("03-01-0[15]-01-0?-01-01.flac")):
        audio, rate = load_audio(sound)
        save_float_wav(folder / f"{sound.stem}.wav", 1.7 * audio / np.abs(audio).max(), rate)
        count = round(len(audio) / rate * 120)
        np.savez(folder / f"{sound.stem}.npz", frames=np.tile(NEUTRAL, (count, 1, 1)), head=np.zeros((count, 6)))
        (folder / f"{sound.stem}.txt").write_text(words[sound.stem.split("-")[4]], encoding="utf-8")
    corpus = new_corpus(tmp_path / "c")
    assert len(add(corpus, [folder]).added) == 4
    before = contents(corpus.path)
    assert len(align(corpus).aligned) == 4
    assert contents(corpus.path) == before


def save_float_wav(path, audio, rate):
    import soundfile

    soundfile.write(path, audio, rate, subtype="FLOAT")
