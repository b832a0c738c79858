"""What is wrong with the built-in performer's recordings, written down, so that finding it can be tested."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from facesynth.atomic import write_text
from facesynth.inference.errors import FacesynthError
from facesynth.performer.capture import Fault

FILE = "performer_truth.json"


def read_truth(corpus_path: str | Path) -> dict[str, tuple[Fault, ...]]:
    """Faults by utterance id; utterances without one are there with none."""
    path = Path(corpus_path) / FILE
    if not path.is_file():
        raise FacesynthError(f"{path} is missing; only corpora of the built-in performer have one")
    try:
        plain: dict[str, list[dict[str, Any]]] = json.loads(path.read_text(encoding="utf-8"))
        return {utterance: tuple(_fault(fault) for fault in faults) for utterance, faults in plain.items()}
    except (UnicodeDecodeError, json.JSONDecodeError, AttributeError, KeyError, TypeError) as error:  # of the file's form
        raise FacesynthError(f"{path} is damaged ({error}); delete the folder and build the performer again") from None


def write_truth(corpus_path: str | Path, truth: Mapping[str, Sequence[Fault]]) -> None:
    """Write all faults, by utterance id, atomically."""
    lines = [
        f"{json.dumps(utterance)}: {json.dumps([fault.to_dict() for fault in truth[utterance]])}" for utterance in sorted(truth)
    ]
    write_text(Path(corpus_path) / FILE, "{\n" + ",\n".join(lines) + "\n}\n")


def _fault(plain: Mapping[str, Any]) -> Fault:
    return Fault(plain["kind"], tuple(plain["markers"]), plain["start"], plain["stop"], plain["phone"])
