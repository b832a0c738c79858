"""A project: what is changed can be undone, is kept, and says the same in the files that `speak` takes."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from sentences import CONFIDENCES, RATE, facts, project_with_line, sound

from facesynth.corpus.journal import Journal
from facesynth.inference.errors import FacesynthError
from facesynth.speech.emotions import read_emotions
from facesynth.speech.textgrid import read_textgrid
from facesynth.studio.commands import changed
from facesynth.studio.document import Document, take_of
from facesynth.studio.project import Project

HERE = {"line": "hello", "take": "1"}


def some_change(rng, take):
    """A change that may or may not be possible."""
    phone, time_s = int(rng.integers(0, len(take.phones))), float(np.round(rng.uniform(0, 1), 4))
    label = str(rng.choice(["aa", "m", "s", "pau"]))
    return [
        ("move_boundary", {"phone": phone, "end_s": time_s}),
        ("relabel", {"phone": phone, "label": label}),
        ("split_phone", {"phone": phone, "at_s": time_s, "label": label}),
        ("join_phones", {"phone": phone}),
        ("pin", {"phone": phone, "node": "s01_happy:4"}),
        ("unpin", {"phone": phone}),
        ("paint_emotion", {"start_s": time_s, "end_s": time_s + 0.3, "emotion": "angry", "intensity": 0.5}),
        ("move_emotion", {"region": 0, "end_s": time_s}),
        ("cross_fade", {"region": 0, "length_s": 0.2}),
        ("set_curve", {"points": [[0.1, 0.5], [time_s + 0.2, 1.0]]}),
    ][int(rng.integers(0, 10))]


def played(project, count, seed=0):
    """Make many changes; gives the documents after each that was possible."""
    rng, documents = np.random.default_rng(seed), [project.document]
    for _ in range(count):
        do, what = some_change(rng, project.document.line("hello").take("1"))
        try:
            project.change(do, {**HERE, **what})
        except FacesynthError:
            assert project.document is documents[-1]
            continue
        documents.append(project.document)
    return documents


@pytest.mark.parametrize("seed", range(3))
def test_everything_can_be_undone_and_done_again(tmp_path, seed):
    project = project_with_line(tmp_path / "p")
    documents = played(project, 40, seed)
    assert len(documents) > 12
    for document in documents[-2::-1]:
        project.change("undo", {})
        assert project.document == document
    for document in documents[1:]:
        project.change("redo", {})
        assert project.document == document
    assert not project.can_redo


@pytest.mark.parametrize("seed", range(3))
def test_files_say_what_the_take_says(tmp_path, seed):
    """Whatever was changed: what `speak` reads is what is shown, to the last digit."""
    project = project_with_line(tmp_path / "p")
    played(project, 40, seed)
    take, folder = project.document.line("hello").take("1"), project.take_folder("hello", "1")
    phones, words = read_textgrid(folder / "phones.TextGrid")
    sure = np.ones(len(phones)) if phones.confidences is None else phones.confidences
    assert list(zip(phones.labels, phones.ends_s, sure, strict=True)) == list(take.phones)
    assert tuple(words) == take.words
    emotions, wanted = read_emotions(folder / "emotions.csv", 1.0), take.emotion_track()
    assert emotions.labels == wanted.labels
    np.testing.assert_allclose(emotions.ends_s, wanted.ends_s, atol=1e-6)
    np.testing.assert_allclose(emotions.intensities, wanted.intensities, rtol=1e-5)
    assert all(take.phones[pin.phone].label != "pau" for pin in take.pins)
    assert len((folder / "constraints.csv").read_text().splitlines()) == 1 + len(take.pins)


@pytest.mark.parametrize(
    ("do", "what", "vouched"),
    [
        ("move_boundary", {"phone": 2, "end_s": 0.41}, {2, 3}),
        ("relabel", {"phone": 2, "label": "aa"}, {2}),
        ("join_phones", {"phone": 3}, {3}),
        ("pin", {"phone": 2, "node": "s01_happy:4"}, set()),
    ],
)
def test_who_changes_a_phone_vouches_for_it(tmp_path, do, what, vouched):
    project = project_with_line(tmp_path / "p")
    project.change(do, {**HERE, **what})
    phones = project.document.line("hello").take("1").phones
    kept = CONFIDENCES if len(phones) == len(CONFIDENCES) else (*CONFIDENCES[:4], *CONFIDENCES[5:])
    assert [phone.confidence for phone in phones] == [1.0 if k in vouched else kept[k] for k in range(len(phones))]


def test_a_take_that_was_kept_without_confidences_is_read():
    take = take_of({**facts()["take"], "phones": [["pau", 0.4], ["m", 1.0]]})
    assert take.phone_track().labels == ("pau", "m")
    assert take.phone_track().confidences is None


@pytest.mark.parametrize("confidence", [float("nan"), -0.1, 95])
def test_a_confidence_that_is_none_is_refused_before_it_is_kept(tmp_path, confidence):
    project, said = project_with_line(tmp_path / "p"), facts()
    said |= {"name": "other", "take": {**said["take"], "phones": [["pau", 0.4], ["m", 1.0, confidence]]}}
    with pytest.raises(FacesynthError, match="0 to 1"):
        project.change("add_line", said)
    assert [line.name for line in project.document.lines] == ["hello"]


def test_a_project_comes_back_as_it_was(tmp_path):
    project = project_with_line(tmp_path / "p")
    played(project, 30)
    project.change("undo", {})
    document, revision = project.document, project.revision
    project.close()
    again = Project.open(tmp_path / "p")
    assert (again.document, again.revision) == (document, revision)
    again.change("redo", {})
    assert again.can_undo


def test_a_journal_cut_anywhere_is_the_changes_before_the_cut(tmp_path):
    """What stands in whole lines is kept; half a line was never told to be."""
    project = project_with_line(tmp_path / "p")
    played(project, 8)
    project.close()
    journal = tmp_path / "p/journal.jsonl"
    data = journal.read_bytes()
    first = data.index(b"\n") + 1
    for cut in range(first, len(data), 17):
        journal.write_bytes(data[:cut])
        again = Project.open(tmp_path / "p")
        assert again.revision == data[:cut].count(b"\n")
        again.close()
        assert journal.read_bytes() == data[: data[:cut].rindex(b"\n") + 1]


def test_damage_inside_is_one_clear_line(tmp_path):
    project_with_line(tmp_path / "p").close()
    journal = tmp_path / "p/journal.jsonl"
    journal.write_bytes(journal.read_bytes() + b'{"do": "relabel"\n{"do":"undo","with":{}}\n')
    with pytest.raises(FacesynthError, match=r"journal.jsonl, line 2 is damaged.*restore the file"):
        Project.open(tmp_path / "p")
    journal.write_bytes(journal.read_bytes().splitlines(keepends=True)[0] + b'{"do":"redo","with":{}}\n')
    with pytest.raises(FacesynthError, match="line 2 cannot be done: there is nothing to redo"):
        Project.open(tmp_path / "p")
    (tmp_path / "p/project.json").write_text("{")
    with pytest.raises(FacesynthError, match="project.json is damaged"):
        Project.open(tmp_path / "p")


def test_one_studio_at_a_time(tmp_path):
    project = project_with_line(tmp_path / "p")
    with pytest.raises(FacesynthError, match="open in another studio"):
        Project.open(tmp_path / "p")
    project.close()
    Project.open(tmp_path / "p").close()


def test_what_another_window_changed_is_not_changed_unseen(tmp_path):
    project = project_with_line(tmp_path / "p")
    project.keep_sound("other", sound(), RATE)
    project.change("add_line", {**facts(), "name": "other"})
    seen = project.revision
    project.change("relabel", {**HERE, "phone": 2, "label": "aa"}, seen)
    with pytest.raises(FacesynthError, match="another window changed this"):
        project.change("relabel", {**HERE, "phone": 2, "label": "m"}, seen)
    with pytest.raises(FacesynthError, match="another window"):
        project.change("undo", {}, seen)
    project.change("relabel", {"line": "other", "take": "1", "phone": 2, "label": "m"}, seen)
    assert project.document.line("hello").take("1").phones[2].label == "aa"


@pytest.mark.parametrize(
    ("do", "what", "said"),
    [
        ("move_boundary", {"phone": 1, "end_s": 0.1}, "can end from 0.205 to 0.395 s"),
        ("move_boundary", {"phone": 5, "end_s": 0.9}, "no boundary 5"),
        ("move_boundary", {"phone": 1, "end_s": float("nan")}, "finite"),
        ("move_boundary", {"phone": "1", "end_s": 0.3}, "phone must be a whole number"),
        ("move_boundary", {"phone": 1}, "wants line, take, phone, end_s"),
        ("relabel", {"phone": 1, "label": "qq"}, "unknown phone 'qq'"),
        ("pin", {"phone": 0, "node": "a:1"}, "silence"),
        ("split_phone", {"phone": 0, "at_s": 0.1, "label": "pau"}, "two silences"),
        ("paint_emotion", {"start_s": 0.1, "end_s": 0.5, "emotion": "angry", "intensity": 1.5}, "from 0 to 1"),
        ("set_curve", {"points": [[0.5, 1], [0.2, 1]]}, "rise"),
        ("remove_take", {}, "this take alone"),
        ("fly", {}, "unknown change"),
    ],
)
def test_what_cannot_be_done_is_told(tmp_path, do, what, said):
    project = project_with_line(tmp_path / "p")
    with pytest.raises(FacesynthError, match=said):
        project.change(do, {**HERE, **what})
    assert project.revision == 1


def node_of(title):
    return {"title": title, "phone": "aa", "emotion": "neutral", "frames": [[0.0, 1.0], [0.5, 1.5]]}


def test_a_corpus_takes_over_edits_once_and_what_is_undone_is_taken_back(tmp_path):
    project, corpus = project_with_line(tmp_path / "p"), tmp_path / "corpus"
    corpus.mkdir()
    journal = Journal(corpus / "edits.jsonl")
    project.change("draw_node", node_of("wide"))
    project.change("remove_node", {"node": "s01_happy:4"})
    assert project.keep_edits(corpus) == 2
    with pytest.raises(FacesynthError, match="has all of these"):
        project.keep_edits(corpus)
    project.change("draw_node", node_of("round"))
    project.change("restore_node", {"node": "s01_happy:4"})
    assert project.keep_edits(corpus) == 2
    assert journal.removed() == frozenset()
    assert [(one.name, one.title) for one in journal.added()] == [(name, node.title) for name, node in project.drawn]
    for _ in range(4):
        project.change("undo", {})
    project.close()
    project = Project.open(tmp_path / "p")
    project.keep_edits(corpus)
    assert journal.added() == ()
    assert Journal(project.edits).sum().added == ()
    journal.remove("s02_sad:1")
    project.change("remove_node", {"node": "s01_happy:5"})
    with pytest.raises(FacesynthError, match="was changed elsewhere"):
        project.keep_edits(corpus)


def test_silence_that_was_made_is_one_silence_and_pins_follow_their_phones():
    document = changed(Document(), "add_line", facts())
    for do, what in [("pin", {"phone": 4, "node": "a:1"}), ("relabel", {"phone": 1, "label": "pau"})]:
        document = changed(document, do, {**HERE, **what})
    take = document.line("hello").take("1")
    assert [phone.label for phone in take.phones] == ["pau", "ah", "l", "ow", "pau"]
    assert take.pins == ((3, "a:1"),)
    removed = changed(document, "remove_node", {"node": "a:1"})
    assert removed.line("hello").take("1").pins == ()


WORKER = """
import sys
from pathlib import Path
from facesynth.studio.project import Project
project = Project.open(Path(sys.argv[1]))
for number in range(100000):
    kept = project.change("relabel", {"line": "hello", "take": "1", "phone": 2, "label": "aa" if number % 2 else "ah"})
    print(kept.revision, flush=True)
"""


def killed_after(folder, seconds):
    """Revision that was told to be kept by a program that was then killed."""
    worker = subprocess.Popen([sys.executable, "-c", WORKER, str(folder)], stdout=subprocess.PIPE, text=True)
    first = worker.stdout.readline()
    time.sleep(seconds)
    worker.send_signal(signal.SIGKILL)
    rest = worker.communicate()[0].splitlines()
    whole = [line for line in rest[:-1] if line] or [first]
    return int(whole[-1])


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system kills otherwise")
@pytest.mark.parametrize("moments", [2, pytest.param(50, marks=pytest.mark.slow)])
def test_what_was_told_to_be_kept_outlives_a_kill(tmp_path, moments):
    project_with_line(tmp_path / "p").close()
    rng = np.random.default_rng(moments)
    for _ in range(moments):
        kept = killed_after(tmp_path / "p", rng.uniform(0, 0.15))
        project = Project.open(tmp_path / "p")
        assert project.revision >= kept
        document = project.document
        project.close()
        again = Project.open(tmp_path / "p")
        assert again.document == document
        again.close()
