"""Placing the phones of utterances anew; what a person corrected stays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from facesynth.corpus.corpus import Corpus
from facesynth.corpus.files import Files
from facesynth.corpus.record import Record
from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.hashing import hash_file
from facesynth.inference.errors import FacesynthError
from facesynth.speech.audio import load_audio
from facesynth.speech.textgrid import write_textgrid

if TYPE_CHECKING:
    from facesynth.speech.phone_sources import FoundPhones


@dataclass(frozen=True)
class AlignReport:
    """What became of each utterance's phones, by id."""

    aligned: tuple[str, ...]
    kept: Mapping[str, str]
    """Why the phones stay as they are."""
    failed: Mapping[str, str]
    """Why they could not be placed; they too stay as they are."""
    warnings: Mapping[str, tuple[str, ...]]


def align(corpus: Corpus, ids: Iterable[str] | None = None, force: bool = False, workers: Workers = ALONE) -> AlignReport:
    """Align sound and text of the utterances `ids` (else of all) and write their TextGrids.

    Phones that a person gave or corrected are kept unless `force` is set. Where there is neither text nor phones, these are
    recognised from the sound. The result is the same whoever does the work.
    """
    aligned: list[str] = []
    failed: dict[str, str] = {}
    warnings: dict[str, tuple[str, ...]] = {}
    records = corpus.records if ids is None else tuple(corpus.record(utterance_id) for utterance_id in ids)
    reasons = {record.id: _reason_to_keep(corpus, record, force) for record in records}
    records = tuple(record for record in records if not reasons[record.id])
    results = spread(partial(_attempt, corpus.files), records, workers, "aligning")
    for record, placed in zip(records, results, strict=True):
        if isinstance(placed, FacesynthError):
            failed[record.id] = str(placed)
            continue
        _keep(corpus, record, placed)
        aligned.append(record.id)
        warnings.update({record.id: placed.remarks} if placed.remarks else {})
    return AlignReport(tuple(aligned), {name: reason for name, reason in reasons.items() if reason}, failed, warnings)


def is_by_hand(corpus: Corpus, record: Record) -> bool:
    """Whether a person gave the phones, or changed what an aligner wrote."""
    path = corpus.files.phones(record.id)
    return path.is_file() and hash_file(path) != record.aligned_hash


def _reason_to_keep(corpus: Corpus, record: Record, force: bool) -> str:
    if not record.text and record.id not in corpus.subset([record.id]).without_phones():
        return "there is no text to align"
    if is_by_hand(corpus, record) and not force:
        return "the phones were given or corrected by hand; --force places them anew"
    return ""


def _attempt(files: Files, record: Record) -> FoundPhones | FacesynthError:
    from facesynth.speech.phone_sources import find_phones

    try:
        return find_phones(*load_audio(files.audio(record.id)), text=record.text or None)
    except FacesynthError as error:
        return error


def _keep(corpus: Corpus, record: Record, placed: FoundPhones) -> None:
    """The TextGrid first, then its hash: interrupted between, the file counts as corrected by hand, which is safe."""
    path = corpus.files.phones(record.id)
    write_textgrid(path, placed.phones, placed.words)
    corpus.update(replace(record, aligned_hash=hash_file(path)))
