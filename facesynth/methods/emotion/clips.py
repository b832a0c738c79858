"""Recordings to learn emotions from: a corpus, or a list of sound files."""

import csv
from pathlib import Path

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.methods.emotion.detector import Clip
from facesynth.progress import track
from facesynth.speech.audio import load_audio

COLUMNS = ("file", "emotion", "speaker", "sentence")


def clips_of_corpus(corpus: Corpus) -> list[Clip]:
    """The sound of every usable utterance."""
    return [
        Clip(u.speech.audio, u.speech.sample_rate, u.emotion, u.performer, u.sentence)
        for u in track(corpus, "recordings", len(corpus))
    ]


def clips_of_list(path: str | Path) -> list[Clip]:
    """The sound files that a CSV names: columns file (beside the list), emotion, and, if known, speaker, sentence."""
    path = Path(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            rows, names = list(reader), tuple(reader.fieldnames or ())
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path}: cannot be read as a list of recordings ({error})") from None
    for column in names:
        if column not in COLUMNS:
            raise unknown("column", column, COLUMNS)
    if not {"file", "emotion"} <= set(names) or not rows:
        raise FacesynthError(f"{path}: wanted lines under the columns file,emotion[,speaker,sentence]; got {','.join(names)}")
    return [_clip(path.parent, row) for row in track(rows, "recordings", len(rows))]


def _clip(folder: Path, row: dict[str, str]) -> Clip:
    audio, rate = load_audio(folder / row["file"])
    return Clip(audio, rate, row["emotion"], row.get("speaker") or "", row.get("sentence") or "")
