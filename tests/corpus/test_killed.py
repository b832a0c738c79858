import numpy as np
import pytest
from corpora import tiny_layout, tiny_utterances
from interrupted import killed_and_repeated

from facesynth.corpus import Corpus
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid


@pytest.fixture
def session(tmp_path):
    """Eight recordings: sound, phones and 3-D markers."""
    folder = tmp_path / "session"
    folder.mkdir()
    for record, speech, motion in tiny_utterances(8):
        save_wav(folder / f"{record.id}.wav", speech.audio, speech.sample_rate)
        write_textgrid(folder / f"{record.id}.TextGrid", speech.phones, ())
        np.savez(folder / f"{record.id}.npz", frames=motion.frames, fps=motion.fps, head=motion.head, eyes=motion.eyes)
    return folder


def new(folder):
    Corpus.create(folder, performer="A", layout=tiny_layout(), fps=120, emotions=["neutral"])


def test_killed_five_times_and_run_again_gives_the_same_bytes(session, tmp_path):
    killed_and_repeated([str(session)], tmp_path, 5, seed=5, new=new)


@pytest.mark.slow
def test_killed_fifty_times_and_run_again_gives_the_same_bytes(session, tmp_path):
    killed_and_repeated([str(session)], tmp_path, 50, seed=7, new=new)
