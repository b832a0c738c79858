"""What can be wrong with a corpus as a whole, though each file by itself is right."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from facesynth.corpus.checks.problem import Problem, attempt
from facesynth.corpus.files import Files
from facesynth.corpus.header import Header
from facesynth.corpus.journal import ADDED, Journal, parse_node
from facesynth.corpus.record import Record, plain_words
from facesynth.corpus.splits import by_sentence
from facesynth.hashing import hash_file
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import PHONES
from facesynth.speech.audio import load_audio

FOLDERS = {"audio": ".wav", "phones": ".TextGrid", "motion": ".npz", "emotions": ".csv"}
TABLE = "utterances.csv"
PRINTS_PER_S = 100
SMOOTHED = 3
MOST_SHIFTED_S = 0.3
SAME_SOUND = 0.9
"""Correlation above which one is a copy. GRID talker: other sentences reach 0.74, copies cut and made softer 0.91 to 0.99."""


def duplicates(files: Files, records: Iterable[Record]) -> Iterator[Problem]:
    """The same sound, or the same motion, in two utterances."""
    records = [record for record in records if record.usable]
    for what, path_of in (("sound", files.audio), ("motion", files.motion)):
        same: dict[str, list[str]] = defaultdict(list)
        for record in records:
            with suppress(FacesynthError, OSError):
                same[hash_file(path_of(record.id))].append(record.id)
        for ids in same.values():
            if len(ids) > 1:
                yield Problem(TABLE, f"{', '.join(ids)} have the same {what}", "keep one, mark the others unusable")


def nearly_duplicates(files: Files, records: Iterable[Record]) -> Iterator[Problem]:
    """The same sound in two utterances, though not to the byte: converted, made louder or softer, or cut a little differently."""
    prints, ids, hashes = list[NDArray[np.float32]](), list[str](), list[str]()
    for record in records:
        if record.usable:
            with suppress(FacesynthError, OSError):
                prints.append(_fingerprint(files.audio(record.id)))
                hashes.append(hash_file(files.audio(record.id)))
                ids.append(record.id)
    if len(prints) < 2:
        return
    for first, second in zip(*np.nonzero(np.triu(_likeness(prints) > SAME_SOUND, 1)), strict=True):
        if hashes[first] != hashes[second]:
            what = f"{ids[first]} and {ids[second]} have nearly the same sound; is one a copy?"
            yield Problem(TABLE, what, "listen to both; keep one, mark the other unusable", grave=False)


def _fingerprint(path: Path) -> NDArray[np.float32]:
    """[T] how a sound's loudness rises and falls, 100 values a second, of length 1: no two takes share that."""
    audio, rate = load_audio(path)
    step = rate // PRINTS_PER_S
    power = np.square(audio[: len(audio) // step * step], dtype=np.float64).reshape(-1, step).mean(axis=1)
    level = np.log(uniform_filter1d(power, SMOOTHED) + 3e-3 * power.max(initial=1e-12))
    slope = np.gradient(level) if len(level) > 1 else level
    return (slope / max(float(np.linalg.norm(slope)), 1e-12)).astype(np.float32)


def _likeness(prints: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """[N, N] the highest correlation of each with each, over shifts of up to `MOST_SHIFTED_S`."""
    padded = np.zeros((len(prints), max(map(len, prints))), np.float32)
    for row, values in zip(padded, prints, strict=True):
        row[: len(values)] = values
    best = padded @ padded.T
    for shift in range(1, min(int(MOST_SHIFTED_S * PRINTS_PER_S), padded.shape[1] - 1) + 1):
        alike = padded[:, shift:] @ padded[:, :-shift].T
        best = np.maximum(best, np.maximum(alike, alike.T))
    return np.asarray(best)


def sentences(records: Iterable[Record]) -> Iterator[Problem]:
    """Sentences that cannot be split, are on both sides, or have two names."""
    records = [record for record in records if record.usable]
    groups = by_sentence(records)
    if len(records) == 0:
        yield Problem(TABLE, "there is no usable utterance", "add recordings with `facesynth corpus add`")
    elif len(groups) == 1:
        few = "one utterance" if len(records) == 1 else "one sentence"
        yield Problem(TABLE, f"there is only {few}; nothing is left to test on", "add recordings of other sentences")
    for sentence, group in groups.items():
        if {"train", "test"} <= {record.split for record in group}:
            ids = ", ".join(record.id for record in group)
            yield Problem(TABLE, f"sentence {sentence!r} is in training and in test ({ids})", "put it on one side")
    names: dict[str, set[str]] = defaultdict(set)
    for record in records:
        names[plain_words(record.text)].add(record.sentence_key)
    for text, known in names.items():
        if text and len(known) > 1:
            what = f"{text!r} is called {' and '.join(map(repr, sorted(known)))}, so it may be trained and tested on"
            yield Problem(TABLE, what, "give it one name in the column 'sentence'")


def strays(files: Files, records: Mapping[str, Record]) -> Iterator[Problem]:
    """Files that belong to no utterance."""
    for folder, suffix in FOLDERS.items():
        for path in sorted(p for p in (files.root / folder).glob("*") if p.name != ".DS_Store"):
            if path.name.startswith(".part-"):
                yield Problem(f"{folder}/{path.name}", "a write was interrupted here", "delete it", grave=False)
            elif not path.name.endswith(suffix):
                yield Problem(f"{folder}/{path.name}", f"only {suffix} files belong here", "move it away", grave=False)
            elif path.name[: -len(suffix)] not in records:
                yield Problem(
                    f"{folder}/{path.name}", f"{TABLE} does not list it", "add the recording again, or delete it", grave=False
                )


def rights(header: Header, records: Iterable[Record]) -> Iterator[Problem]:
    """Recordings without a licence, or without the performer's consent."""
    usable = [record for record in records if record.usable]
    for what in ("licence", "consent"):
        lacking = [record.id for record in usable if not getattr(record, what) and not getattr(header, what)]
        if lacking:
            some = ", ".join(lacking[:3]) + (" …" if len(lacking) > 3 else "")
            do = f"state the {what} in corpus.yaml or {TABLE}; every model carries it"
            yield Problem("corpus.yaml", f"{len(lacking)} utterances state no {what} ({some})", do, grave=False)


def edits(files: Files, header: Header, records: Mapping[str, Record], phones: Mapping[str, int]) -> list[Problem]:
    """Edits that cannot be read, or that name what does not exist; phones: how many each readable utterance has."""
    problems: list[Problem] = []
    name = "edits.jsonl"
    journal = attempt(problems, name, "mend the file", lambda: Journal(files.journal))
    removed = journal and attempt(problems, name, "mend or delete the line", journal.removed)
    for node in sorted(removed or ()):
        utterance_id, number = _parsed(node)
        known = utterance_id == ADDED or (utterance_id in records and number < phones.get(utterance_id, number + 1))
        if not known:
            problems.append(Problem(name, f"removed node {node} does not exist", "undo the edit, or restore the utterance"))
    added = attempt(problems, name, "mend or delete the line", journal.added) if journal and removed is not None else ()
    for new in added or ():
        fits = new.frames.ndim == 2 and new.frames.shape[1] == header.layout.channels
        if not fits or new.phone not in PHONES or new.emotion not in header.emotions:
            what = f"added node {new.name} ({new.phone}, {new.emotion}, frames {list(new.frames.shape)}) does not fit this corpus"
            problems.append(Problem(name, what, f"delete the line; frames are [L, {header.layout.channels}]"))
    return problems


def _parsed(node: str) -> tuple[str, int]:
    try:
        return parse_node(node)
    except FacesynthError:
        return "", 0
