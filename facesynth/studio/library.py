"""The corpus as the page shows it, and whether it changed on the disk meanwhile."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from facesynth.corpus import Corpus, Utterance
from facesynth.corpus.align import is_by_hand
from facesynth.inference.errors import FacesynthError
from facesynth.speech.segments import Segment
from facesynth.speech.textgrid import read_textgrid

Signature = Mapping[str, tuple[int, int]]
"""Time of change (ns) and size of what a corpus consists of, by name."""


def corpus_facts(corpus: Corpus) -> dict[str, Any]:
    """What is in a corpus."""
    rows = [
        {
            "id": record.id,
            "text": record.text,
            "emotion": record.emotion,
            "take": record.take,
            "usable": record.usable,
            "reason": record.reason,
            "duration_s": round(_duration_s(corpus, record.id), 2),
            "by_hand": is_by_hand(corpus, record),
        }
        for record in corpus.records
    ]
    layout = corpus.layout
    return {
        "path": str(corpus.path),
        "performer": corpus.performer,
        "synthetic": corpus.synthetic,
        "emotions": list(corpus.emotions),
        "layout": f"{len(layout.names)} {layout.kind}",
        "fps": corpus.fps,
        "utterances": rows,
    }


def recorded(corpus: Corpus, utterance: str) -> tuple[Utterance, tuple[Segment, ...]]:
    """An utterance and its words."""
    found = corpus[utterance]
    _, words = read_textgrid(corpus.files.phones(utterance))
    return found, tuple(words)


def set_text(corpus: Corpus, utterance: str, text: str) -> None:
    """Correct a transcript; the phones are placed anew when somebody aligns."""
    record = corpus.record(utterance)
    if record.text == text:
        raise FacesynthError(f"{utterance} has this transcript already")
    corpus.update(replace(record, text=text))


def signature(corpus: Path, model: Path | None) -> Signature:
    """What tells that something changed on the disk: the tables, the folders of files, and the model."""
    names = ("corpus.yaml", "utterances.csv", "edits.jsonl", "phones", "motion", "audio", "emotions")
    paths = {name: corpus / name for name in names} | ({"model": model} if model else {})
    return {name: _stamp(path) for name, path in paths.items()}


def differing(before: Signature, after: Signature) -> list[str]:
    """Names of what is not as it was."""
    return [name for name in {**before, **after} if before.get(name) != after.get(name)]


def _stamp(path: Path) -> tuple[int, int]:
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


def _duration_s(corpus: Corpus, utterance: str) -> float:
    try:
        return corpus.duration_s(utterance)
    except (FacesynthError, OSError):  # a sound that is missing is what the check of the corpus tells of
        return 0.0
