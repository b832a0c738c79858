"""Where `speak` writes, and what it must not write over."""

import re
from collections.abc import Sequence
from pathlib import Path

from facesynth.inference.errors import FacesynthError

NAME = "{name}"
CORPUS = "corpus.yaml"
"""What lies in the folder of a corpus."""


def plan_targets(
    recordings: Sequence[Path], outputs: Sequence[Path], folders: Sequence[Path], kept: Sequence[Path] = ()
) -> dict[Path, list[Path]]:
    """What is written for each recording.

    Files inside `folders` that are results of other recordings there, from an earlier run, are no recordings. A
    FacesynthError refuses what would be written over a recording, a file of a corpus, or one of `kept`, or twice.
    """
    for output in outputs:
        if odd := [field for field in re.findall(r"\{[^{}]*\}", str(output)) if field != NAME]:
            raise FacesynthError(f"{output}: {odd[0]} stands for nothing; {NAME} stands for the name of the speech file")
    plan = {path: [Path(str(output).replace(NAME, path.stem)) for output in outputs] for path in recordings}
    results = {target.resolve(): path for path, targets in plan.items() for target in targets}
    for path in recordings:
        if path.parent in folders and results.get(path.resolve(), path) != path:
            del plan[path]
    _check_free(plan)
    for target in dict.fromkeys(target for targets in plan.values() for target in targets):
        require_free(target, kept)
    return plan


def require_free(target: Path, kept: Sequence[Path]) -> None:
    """FacesynthError where a target is one of the files that are read, or a file of a corpus."""
    place = target.resolve()
    if any(place == path.resolve() or _is_same(target, path) for path in kept):
        raise FacesynthError(f"{target} is read, and would be written over; write to another file")
    if target.exists() and any((folder / CORPUS).is_file() for folder in (place.parent, place.parent.parent)):
        raise FacesynthError(f"{target} belongs to a corpus; write to another file")


def _is_same(target: Path, path: Path) -> bool:
    """Whether two names are of one file, on a disk that does not tell cases apart too."""
    return target.exists() and path.exists() and target.samefile(path)


def _check_free(plan: dict[Path, list[Path]]) -> None:
    sources = {path.resolve() for path in plan}
    writers: dict[Path, Path] = {}
    for path, targets in plan.items():
        for target in targets:
            if target.resolve() in sources:
                raise FacesynthError(f"{target} is a recording that is to be spoken; write to another file")
            if (other := writers.setdefault(target.resolve(), path)) != path:
                raise FacesynthError(f"{other.name} and {path.name} would both be written to {target}; rename one of them")
