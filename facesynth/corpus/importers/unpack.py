"""Sound, phones and words that lie in the file of the motion, laid beside it for as long as a recording is added."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from facesynth.atomic import write_text
from facesynth.corpus.add.given import Given
from facesynth.corpus.add.recordings import VIDEO, Recording, words_of
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.eyes import NO_SPEECH
from facesynth.corpus.importers.formats import read
from facesynth.corpus.importers.reading import Reading
from facesynth.corpus.importers.session import kept_written
from facesynth.corpus.motion_files import into_corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.phones import SILENCE
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid

QUIET = "no speech.lab"
"""Name of the file of phones that says so."""
QUIET_RATE = 16000
"""Hz of the silence that stands for no sound."""


def read_into(corpus: Corpus, recording: Recording) -> tuple[Motion, tuple[str, ...]]:
    """The motion of a recording of any system, in the corpus' layout and at its rate, and what was noticed."""
    path = recording.motion
    reading = _read(corpus, path)
    try:
        motion, remarks = into_corpus(reading.motion, corpus.layout, corpus.fps)
    except FacesynthError as error:
        raise FacesynthError(f"{path}: {error}") from None
    silent = (f"{NO_SPEECH}; lay {recording.name}.wav beside it for more",) if _is_silent(recording) else ()
    return motion, (*silent, *reading.remarks, *remarks)


@contextmanager
def unpacked(corpus: Corpus, recording: Recording) -> Iterator[Recording]:
    """The recording with files for its sound, its phones and its words, until the block ends.

    A recording without any sound that shows eyes and blinks gets silence and the phone of silence: `with_unpacked` marks it.
    FacesynthError where another has no sound.
    """
    if recording.sound != recording.motion or recording.motion.suffix.lower() in VIDEO:
        yield recording
        return
    reading = _read(corpus, recording.motion)
    if reading.sound is None and not reading.silent:
        raise FacesynthError(
            f"there is no sound in {recording.motion.name} and none beside it ({recording.name}.wav);"
            " motion without sound teaches no speech"
        )
    with tempfile.TemporaryDirectory(prefix="facesynth-") as name:
        folder = Path(name) / recording.motion.resolve().parent.name
        folder.mkdir()
        yield _laid_out(folder, recording, reading)


def with_unpacked(corpus: Corpus, given: Given, recording: Recording) -> Given:
    """What is given, with the files and the words that were found in the file of the motion.

    Without sound the recording is not usable for speech, and says so; where a sound has come since, it is.
    """
    facts = dict(given.facts)
    if _is_silent(recording):
        facts |= {"usable": False, "reason": NO_SPEECH}
    elif given.id in corpus and corpus.record(given.id).reason == NO_SPEECH:
        facts |= {"usable": True, "reason": ""}
    if recording.text is not None and recording.text != given.recording.text and not facts.get("text"):
        facts["text"] = words_of(recording.text)
    return replace(given, recording=recording, facts=facts)


def _is_silent(recording: Recording) -> bool:
    """Whether an unpacked recording has no sound."""
    return recording.phones is not None and recording.phones.name == QUIET


def _read(corpus: Corpus, path: Path) -> Reading:
    return read(path, None, corpus.fps, kept_written(corpus.path), otherwise=corpus.layout)


def _laid_out(folder: Path, recording: Recording, reading: Reading) -> Recording:
    sound, phones, text = folder / f"{recording.name}.wav", recording.phones, recording.text
    if reading.sound is None:
        duration_s = reading.motion.duration_s
        save_wav(sound, np.zeros(round(duration_s * QUIET_RATE), np.float32), QUIET_RATE)
        write_text(folder / QUIET, f"{duration_s:.6f} {SILENCE}\n")
        return replace(recording, sound=sound, phones=folder / QUIET)
    save_wav(sound, reading.sound.audio, reading.sound.sample_rate)
    if phones is None and reading.phones is not None:
        phones = folder / f"{recording.name}.TextGrid"
        write_textgrid(phones, reading.phones, reading.words)
    if text is None and reading.text:
        text = folder / f"{recording.name}.txt"
        write_text(text, reading.text + "\n")
    return replace(recording, sound=sound, phones=phones, text=text)
