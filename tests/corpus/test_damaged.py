"""Damaged files of every kind that lies beside a recording, or in a corpus: a reason each, the rest is imported."""

import resource
import shutil
from contextlib import contextmanager, suppress

import numpy as np
import pytest
from corpora import EMOTIONS, label_lines, tiny_corpus, tiny_layout, tiny_utterances

from facesynth.corpus import Corpus
from facesynth.corpus.add.add import add
from facesynth.corpus.add.prepare import FAULT
from facesynth.corpus.add.transcripts import read_transcripts
from facesynth.corpus.checks.check import check
from facesynth.corpus.motion_files import channel_names, load_motion
from facesynth.corpus.record import read_listed
from facesynth.inference.errors import FacesynthError
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid

KINDS = [".wav", ".npz", ".z.npz", ".csv", ".TextGrid", ".lab", ".align", ".txt", ".emotions.csv"]
"""Files of a recording; z: compressed."""
MOST_MB = 400


def hurt(content, trial, rng):
    """A third only changed, the others also cut off; the very first is empty."""
    part = bytearray(content[: int(rng.integers(0, len(content)))] if trial % 3 else content)
    for place in rng.integers(0, max(len(part), 1), int(rng.integers(1, 12))) if part else ():
        part[place] = int(rng.integers(256))
    return bytes(part) if trial else b""


@contextmanager
def little_memory():
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb) / 1024
    assert grown_mb < MOST_MB, "a damaged file of some kilobytes must not take memory by what it claims"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """One good file of each kind."""
    folder = tmp_path_factory.mktemp("whole")
    _, speech, motion = tiny_utterances(1)[0]
    save_wav(folder / "a.wav", speech.audio, speech.sample_rate)
    np.savez(folder / "a.npz", frames=motion.frames, fps=120.0, head=motion.head, eyes=motion.eyes)
    np.savez_compressed(folder / "a.z.npz", frames=motion.frames, fps=120.0, head=motion.head)
    header = ",".join(("time_s", *channel_names(tiny_layout())))
    table = np.column_stack([np.arange(len(motion)) / 120, motion.frames])
    np.savetxt(folder / "a.csv", table, delimiter=",", header=header, comments="", fmt="%.4f")
    write_textgrid(folder / "a.TextGrid", speech.phones, [("good", 0.2, 0.5)])
    (folder / "a.lab").write_text(label_lines(speech.phones))
    (folder / "a.align").write_text("0 2000 sil\n2000 9000 good\n9000 20000 day\n", encoding="utf-8")
    (folder / "a.txt").write_text("Good day, and a “naïve” 喜び.\n", encoding="utf-8")
    (folder / "a.emotions.csv").write_text("end_s,emotion,intensity\n0.5,neutral,1\n9,sad,0.5\n", encoding="utf-8")
    (folder / "lines.csv").write_text('id,text\nhurt000,"good day, you"\ngood,hello\n', encoding="utf-8")
    (folder / "list.csv").write_text("id,emotion,take,usable\nhurt000,happy,2,yes\ngood,sad,1,no\n", encoding="utf-8")
    return folder


def recording(whole, folder, name, kind, content):
    """A recording of which one file is damaged."""
    shutil.copy(whole / "a.wav", folder / f"{name}.wav")
    if kind not in (".csv", ".npz", ".z.npz"):
        shutil.copy(whole / "a.npz", folder / f"{name}.npz")
    if kind != ".lab":
        shutil.copy(whole / "a.TextGrid", folder / f"{name}.TextGrid")
    (folder / f"{name}{kind.replace('.z', '')}").write_bytes(content)


def fuzz_add(whole, tmp_path, kind, trials):
    """So many damaged recordings and a good one in one folder; the good one is added, the others are or have a reason."""
    rng = np.random.default_rng(KINDS.index(kind))
    folder = tmp_path / "session"
    folder.mkdir()
    recording(whole, folder, "good", kind, (whole / f"a{kind}").read_bytes())
    for trial in range(trials):
        recording(whole, folder, f"hurt{trial:03d}", kind, hurt((whole / f"a{kind}").read_bytes(), trial, rng))
    corpus = Corpus.create(tmp_path / "c", performer="A", layout=tiny_layout(), fps=120, emotions=EMOTIONS)
    with little_memory():
        report = add(corpus, [folder])
    assert "good" in report.added
    assert len(report.added) + len(report.refused) == trials + 1
    assert not [reason for reason in report.refused.values() if FAULT in reason]
    assert all(reason for reason in report.refused.values())
    assert len(list(Corpus.open(corpus.path))) == len(report.added), "what was added can be read"
    assert (corpus.path / "import.csv").read_text(encoding="utf-8").count("hurt") >= trials


@pytest.mark.parametrize("kind", KINDS)
def test_twenty_damaged_files_of_each_kind_do_not_keep_others_out(whole, tmp_path, kind):
    fuzz_add(whole, tmp_path, kind, 20)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_five_hundred_damaged_files_of_each_kind_do_not_keep_others_out(whole, tmp_path, kind):
    fuzz_add(whole, tmp_path, kind, 500)


def fuzz_reading(whole, tmp_path, trials):
    """Motion, tables of texts and lists, each read by itself."""
    readers = {
        "a.npz": lambda path: load_motion(path, tiny_layout(), 120),
        "a.z.npz": lambda path: load_motion(path, tiny_layout(), 120),
        "a.csv": lambda path: load_motion(path, tiny_layout(), 120),
        "lines.csv": read_transcripts,
        "list.csv": read_listed,
    }
    rng = np.random.default_rng(21)
    with little_memory():
        for name, read in readers.items():
            content = (whole / name).read_bytes()
            assert read(whole / name)
            for trial in range(trials):
                path = tmp_path / f"hurt{name[name.index('.') :]}"
                path.write_bytes(hurt(content, trial, rng))
                with suppress(FacesynthError):
                    read(path)


def test_damaged_motion_and_tables_never_end_in_a_traceback(whole, tmp_path):
    fuzz_reading(whole, tmp_path, 20)


@pytest.mark.slow
def test_five_hundred_damaged_motions_and_tables(whole, tmp_path):
    fuzz_reading(whole, tmp_path, 500)


def fuzz_tables(whole, tmp_path, trials):
    """Damaged tables lying in the folder of the recordings."""
    rng = np.random.default_rng(22)
    for trial in range(trials):
        folder = tmp_path / f"session{trial}"
        folder.mkdir()
        for name in ("good", "hurt000"):
            recording(whole, folder, name, ".txt", b"hello")
        name = ("lines.csv", "list.csv")[trial % 2]
        (folder / name).write_bytes(hurt((whole / name).read_bytes(), trial // 2, rng))
        corpus = Corpus.create(tmp_path / f"c{trial}", performer="A", layout=tiny_layout(), fps=120, emotions=EMOTIONS)
        assert add(corpus, [folder]).added == ("good", "hurt000")


def test_damaged_tables_beside_recordings_do_not_keep_them_out(whole, tmp_path):
    fuzz_tables(whole, tmp_path, 20)


@pytest.mark.slow
def test_five_hundred_damaged_tables(whole, tmp_path):
    fuzz_tables(whole, tmp_path, 500)


def fuzz_check(tmp_path, trials):
    """Every file of a corpus, damaged in turn; `check` says so, and never fails itself."""
    corpus = tiny_corpus(tmp_path / "tiny", 3)
    corpus.remove_node(f"{corpus.ids[0]}:1")
    (corpus.path / "emotions").mkdir(exist_ok=True)
    duration_s = corpus.duration_s(corpus.ids[0])
    text = f"end_s,emotion,intensity\n0.5,neutral,1\n{duration_s:.3f},sad,0.5\n"
    (corpus.path / "emotions" / f"{corpus.ids[0]}.csv").write_text(text, encoding="utf-8")
    with np.load(corpus.files.motion(corpus.ids[1])) as stored:
        np.savez_compressed(corpus.files.motion(corpus.ids[1]), **stored)
    files = [p for p in sorted(corpus.path.rglob("*.*")) if p.is_file() and corpus.ids[2] not in p.name and p.name != ".lock"]
    rng = np.random.default_rng(23)
    check(corpus.path)
    with little_memory():
        for path in files:
            content = path.read_bytes()
            for trial in range(trials):
                path.write_bytes(hurt(content, trial, rng))
                with suppress(FacesynthError):
                    assert isinstance(check(corpus.path), list)
            path.write_bytes(content)


def test_check_of_damaged_files_never_ends_in_a_traceback(tmp_path):
    fuzz_check(tmp_path, 4)


@pytest.mark.slow
def test_check_of_five_hundred_damaged_files_of_each_kind(tmp_path):
    fuzz_check(tmp_path, 500)
