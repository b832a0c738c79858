"""Adding again: only what was given otherwise than before is done anew, and nothing that a person corrected is lost."""

import csv
import os
import shutil
from dataclasses import dataclass, replace

import numpy as np
import pytest
from corpora import EMOTIONS, tiny_layout, tiny_utterances

from facesynth.corpus import Corpus
from facesynth.corpus.add.add import add
from facesynth.corpus.record import COLUMNS
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid

A, B, C = "s00_happy_t1", "s00_neutral_t1", "s00_neutral_t2"


@dataclass(frozen=True)
class Placed:
    phones: PhoneTrack
    words: tuple = ()
    warnings: tuple = ("a guess",)


@pytest.fixture
def aligner(monkeypatch):
    """An aligner whose first phone is as long as the text has letters; it counts its calls."""
    calls = []

    def place(audio, rate, text):
        calls.append(text)
        end_s = len(audio) / rate
        return Placed(PhoneTrack(("pau", "aa", "pau"), np.array([0.01 * len(text), end_s - 0.1, end_s])))

    monkeypatch.setattr("facesynth.speech.phone_sources.align", place)
    return calls


@pytest.fixture
def readings(monkeypatch):
    """Motion files that were read."""
    from facesynth.corpus.add import prepare

    read, real = [], prepare.read_motion
    monkeypatch.setattr(
        prepare, "read_motion", lambda corpus, recording, face: read.append(recording.name) or real(corpus, recording, face)
    )
    return read


@pytest.fixture
def session(tmp_path, aligner):
    """Three recordings with their words."""
    folder = tmp_path / "day1"
    folder.mkdir()
    for record, speech, motion in tiny_utterances(3):
        save_wav(folder / f"{record.id}.wav", speech.audio, speech.sample_rate)
        np.savez(folder / f"{record.id}.npz", frames=motion.frames, head=motion.head, fps=120.0)
        (folder / f"{record.id}.txt").write_text("hello there", encoding="utf-8")
    return folder


def new(path) -> Corpus:
    return Corpus.create(path, performer="A", layout=tiny_layout(), fps=120, emotions=EMOTIONS, licence="CC0", consent="yes")


def added(session, path, about=None, **options):
    corpus = new(path)
    add(corpus, [session], about, **options)
    return corpus


def contents(corpus) -> dict[str, bytes]:
    return {str(f.relative_to(corpus.path)): f.read_bytes() for f in sorted(corpus.path.rglob("*")) if f.is_file()}


def same_as_anew(corpus, session, path, about=None, **options):
    """Whether a corpus that grew holds, byte for byte, what one made of the same files at once holds."""
    return contents(corpus) == contents(added(session, path, about, **options))


def test_corrected_words_are_aligned_anew_and_nothing_else_is_touched(session, tmp_path, aligner, readings):
    corpus = added(session, tmp_path / "c")
    before = contents(corpus)
    (session / f"{A}.txt").write_text("hello you there", encoding="utf-8")
    aligner.clear(), readings.clear()
    report = add(corpus, [session])
    assert report.changed == {A: ("words",)}
    assert report.unchanged == (B, C)
    assert (aligner, readings) == (["hello you there"], []), "nothing is captured again"
    after = contents(corpus)
    changed = {name for name in after if after[name] != before[name] and not name.startswith(".")}
    assert changed == {f"phones/{A}.TextGrid", "utterances.csv"}
    assert same_as_anew(corpus, session, tmp_path / "d")


def test_a_changed_clip_is_taken_anew(session, tmp_path, aligner, readings):
    corpus = added(session, tmp_path / "c")
    _, speech, motion = tiny_utterances(4)[3]
    save_wav(session / f"{B}.wav", speech.audio, speech.sample_rate)
    np.savez(session / f"{B}.npz", frames=motion.frames, head=motion.head, fps=120.0)
    aligner.clear(), readings.clear()
    report = add(corpus, [session])
    assert report.changed == {B: ("motion", "sound")}
    assert (len(aligner), readings) == (1, [B])
    assert len(corpus[B].motion) == len(motion)
    assert same_as_anew(corpus, session, tmp_path / "d")


def test_changed_motion_alone_is_not_heard_again(session, tmp_path, aligner):
    corpus = added(session, tmp_path / "c")
    with np.load(session / f"{C}.npz") as stored:
        np.savez(session / f"{C}.npz", **{**stored, "frames": stored["frames"] + 1})
    aligner.clear()
    assert add(corpus, [session]).changed == {C: ("motion",)}
    assert aligner == []
    assert same_as_anew(corpus, session, tmp_path / "d")


def test_another_emotion_or_take_changes_the_record_alone(session, tmp_path, aligner, readings):
    corpus = added(session, tmp_path / "c", {"emotion": "sad"})
    aligner.clear(), readings.clear()
    report = add(corpus, [session], {"emotion": "happy", "take": 2})
    assert report.changed == dict.fromkeys((A, B, C), ("emotion", "take"))
    assert (aligner, readings) == ([], [])
    assert [(u.emotion, u.take) for u in corpus] == [("happy", 2)] * 3
    assert same_as_anew(corpus, session, tmp_path / "d", {"emotion": "happy", "take": 2})


def test_an_emotion_that_moves_may_come_later(session, tmp_path):
    corpus = added(session, tmp_path / "c")
    (session / f"{A}.emotions.csv").write_text("end_s,emotion,intensity\n0.5,neutral,1\n9,sad,0.5\n", encoding="utf-8")
    assert add(corpus, [session]).changed == {A: ("emotions",)}
    assert corpus[A].speech.emotions.labels == ("neutral", "sad")
    assert same_as_anew(corpus, session, tmp_path / "d")


def test_phones_that_are_given_later_take_the_place_of_aligned_ones(session, tmp_path):
    corpus = added(session, tmp_path / "c")
    record, speech, _ = tiny_utterances(1)[0]
    write_textgrid(session / f"{record.id}.TextGrid", speech.phones)
    assert add(corpus, [session]).changed == {record.id: ("phones",)}
    assert corpus[record.id].speech.phones.labels == speech.phones.labels
    assert corpus.record(record.id).aligned_hash == ""
    assert same_as_anew(corpus, session, tmp_path / "d")


def test_what_is_not_given_this_time_changes_nothing(session, tmp_path):
    texts = {A: "first", B: "second"}
    corpus = added(session, tmp_path / "c", {"emotion": "sad", "licence": "CC BY"}, texts=texts)
    for path in session.glob("*.txt"):
        path.unlink()
    before = contents(corpus)
    assert add(corpus, [session]).unchanged == (A, B, C)
    after = contents(corpus)
    assert {name for name in after if after[name] != before[name]} == {"import.csv"}, "which no longer names the text files"
    assert [(r.text, r.emotion, r.licence) for r in corpus.records][:2] == [("first", "sad", "CC BY"), ("second", "sad", "CC BY")]


def test_what_a_person_changed_in_the_table_stays(session, tmp_path):
    corpus = added(session, tmp_path / "c")
    corpus.update(replace(corpus.record(A), text="corrected", emotion="angry", usable=False, reason="the cat"))
    assert add(corpus, [session]).unchanged == (A, B, C)
    assert corpus.record(A).text == "corrected"


def correct(corpus, utterance_id):
    grid = corpus.files.phones(utterance_id)
    grid.write_text(grid.read_text(encoding="utf-8").replace('"aa"', '"iy"'), encoding="utf-8")


def test_phones_corrected_by_hand_are_kept_and_told_until_they_are_to_be_replaced(session, tmp_path):
    corpus = added(session, tmp_path / "c")
    correct(corpus, A)
    (session / f"{A}.txt").write_text("other words", encoding="utf-8")
    for _ in range(2):
        report = add(corpus, [session])
        assert "--replace" in report.kept[A]
        assert (report.changed, report.unchanged) == ({}, (B, C))
        assert corpus[A].speech.phones.labels == ("pau", "iy", "pau")
        assert corpus.record(A).text == "other words"
    assert add(corpus, [session], replacing=True).changed == {A: ("words",)}
    assert corpus[A].speech.phones.labels == ("pau", "aa", "pau")
    assert same_as_anew(corpus, session, tmp_path / "d")


def test_another_sound_does_not_take_corrected_phones_away(session, tmp_path):
    corpus = added(session, tmp_path / "c")
    correct(corpus, A)
    before = contents(corpus)
    shutil.copy(session / f"{C}.wav", session / f"{A}.wav")
    assert "--replace" in add(corpus, [session]).kept[A]
    after = contents(corpus)
    assert {n for n in after if after[n] != before[n]} <= {"import.csv"}
    assert "sound" in add(corpus, [session], replacing=True).changed[A]
    assert same_as_anew(corpus, session, tmp_path / "d")


def test_a_given_textgrid_corrected_in_the_corpus_is_kept(session, tmp_path):
    record, speech, _ = tiny_utterances(1)[0]
    grid = session / f"{record.id}.TextGrid"
    write_textgrid(grid, speech.phones)
    corpus = added(session, tmp_path / "c")
    own = corpus.files.phones(record.id)
    own.write_text(own.read_text(encoding="utf-8").replace('"ow"', '"aa"'), encoding="utf-8")
    corrected = own.read_bytes()
    write_textgrid(grid, replace(speech.phones, labels=tuple("iy" if label == "ow" else label for label in speech.phones.labels)))
    assert record.id in add(corpus, [session]).kept
    assert own.read_bytes() == corrected


@pytest.mark.parametrize("at", range(5))
def test_a_change_that_was_interrupted_is_done_by_the_next_run(session, tmp_path, monkeypatch, at):
    """Files replaced: sound, phones, motion, utterances.csv, import.csv."""
    corpus = added(session, tmp_path / "c")
    shutil.copy(session / f"{C}.wav", session / f"{A}.wav")
    shutil.copy(session / f"{C}.npz", session / f"{A}.npz")
    real, calls = os.replace, iter(range(99))
    corpus_files = str(corpus.path)

    def failing(source, target):
        if str(target).startswith(corpus_files) and next(calls) == at:
            raise KeyboardInterrupt
        real(source, target)

    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises(KeyboardInterrupt):
        add(corpus, [session])
    monkeypatch.undo()
    monkeypatch.setattr("facesynth.speech.phone_sources.align", _placed)
    add(Corpus.open(corpus.path), [session])
    assert same_as_anew(corpus, session, tmp_path / "d")


def _placed(audio, rate, text):
    end_s = len(audio) / rate
    return Placed(PhoneTrack(("pau", "aa", "pau"), np.array([0.01 * len(text), end_s - 0.1, end_s])))


def test_a_lost_file_is_made_again_and_told(session, tmp_path):
    corpus = added(session, tmp_path / "c")
    before = contents(corpus)
    correct(corpus, A)
    corrected = corpus.files.phones(A).read_bytes()
    corpus.files.motion(A).unlink()
    corpus.files.phones(B).unlink()
    report = add(corpus, [session])
    assert report.changed == {A: ("motion (was lost)", "sound (was lost)"), B: ("phones (was lost)",)}
    assert corpus.files.phones(A).read_bytes() == corrected
    assert {n for n, c in contents(corpus).items() if c != before[n]} <= {f"phones/{A}.TextGrid", "import.csv"}


def without_account(corpus):
    """A corpus as older versions wrote it: nothing is known of what was given."""
    columns = [name for name in COLUMNS if name not in ("given", "remarks")]
    with open(corpus.files.records, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    with open(corpus.files.records, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    (corpus.path / "import.csv").unlink()
    return Corpus.open(corpus.path)


def test_an_older_corpus_is_read_and_learns_what_was_given(session, tmp_path):
    corpus = without_account(added(session, tmp_path / "c"))
    assert len(list(corpus)) == 3
    assert add(corpus, [session]).unchanged == (A, B, C)
    (session / f"{A}.txt").write_text("hello you there", encoding="utf-8")
    assert add(corpus, [session]).changed == {A: ("words",)}


def test_an_older_corpus_keeps_what_may_have_been_corrected(session, tmp_path):
    corpus = without_account(added(session, tmp_path / "c"))
    (session / f"{A}.txt").write_text("hello you there", encoding="utf-8")
    shutil.copy(session / f"{C}.wav", session / f"{B}.wav")
    report = add(corpus, [session])
    assert "words of the corpus stay" in report.kept[A]
    assert "another recording" in report.refused[B]
    report = add(corpus, [session], replacing=True)
    assert report.changed[A] == ("words",)
    assert "sound" in report.changed[B]
