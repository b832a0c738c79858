"""Placing the phones of utterances anew; what a person corrected stays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from facesynth.corpus.corpus import Corpus
from facesynth.corpus.record import Record
from facesynth.corpus.signals import hash_file
from facesynth.errors import FacesynthError
from facesynth.progress import track
from facesynth.speech.audio import load_audio
from facesynth.speech.textgrid import write_textgrid


@dataclass(frozen=True)
class AlignReport:
    """What became of each utterance's phones, by id."""

    aligned: tuple[str, ...]
    kept: Mapping[str, str]
    """Why the phones stay as they are."""
    failed: Mapping[str, str]
    """Why they could not be placed; they too stay as they are."""
    warnings: Mapping[str, tuple[str, ...]]


def align(corpus: Corpus, ids: Iterable[str] | None = None, force: bool = False) -> AlignReport:
    """Align sound and text of the utterances `ids` (else of all) and write their TextGrids.

    Phones that a person gave or corrected are kept unless `force` is set.
    """
    aligned: list[str] = []
    kept: dict[str, str] = {}
    failed: dict[str, str] = {}
    warnings: dict[str, tuple[str, ...]] = {}
    records = corpus.records if ids is None else tuple(corpus.record(utterance_id) for utterance_id in ids)
    for record in track(records, "aligning"):
        reason = _reason_to_keep(corpus, record, force)
        if reason:
            kept[record.id] = reason
            continue
        try:
            said = _align_one(corpus, record)
        except FacesynthError as error:
            failed[record.id] = str(error)
            continue
        aligned.append(record.id)
        warnings.update({record.id: said} if said else {})
    return AlignReport(tuple(aligned), kept, failed, warnings)


def is_by_hand(corpus: Corpus, record: Record) -> bool:
    """Whether a person gave the phones, or changed what an aligner wrote."""
    path = corpus.files.phones(record.id)
    return path.is_file() and hash_file(path) != record.aligned_hash


def _reason_to_keep(corpus: Corpus, record: Record, force: bool) -> str:
    if not record.text:
        return "there is no text to align"
    if is_by_hand(corpus, record) and not force:
        return "the phones were given or corrected by hand; --force places them anew"
    return ""


def _align_one(corpus: Corpus, record: Record) -> tuple[str, ...]:
    """The TextGrid first, then its hash: interrupted between, the file counts as corrected by hand, which is safe."""
    from facesynth.speech.alignment import align as place

    path = corpus.files.phones(record.id)
    placed = place(*load_audio(corpus.files.audio(record.id)), record.text)
    write_textgrid(path, placed.phones, placed.words)
    corpus.update(replace(record, aligned_hash=hash_file(path)))
    return tuple(placed.warnings)
