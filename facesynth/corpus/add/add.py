"""Adding recordings to a corpus: a video each, or a sound and a motion file, with whatever lies beside them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from facesynth.corpus.add.account import write_account
from facesynth.corpus.add.given import Given
from facesynth.corpus.add.prepare import Prepared, attempt
from facesynth.corpus.add.recordings import Recording, find_recordings, find_tables, words_of
from facesynth.corpus.add.transcripts import read_tables
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.files import check_id
from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.inference.errors import FacesynthError


@dataclass(frozen=True)
class AddReport:
    """What became of each recording."""

    added: tuple[str, ...] = ()
    """Ids that are new."""
    changed: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """What was given otherwise than before, by the id of what was there and was done anew as far as needed."""
    kept: Mapping[str, str] = field(default_factory=dict)
    """What stays although something else was given, by id, with how to replace it."""
    unchanged: tuple[str, ...] = ()
    """Ids that were there already."""
    refused: Mapping[str, str] = field(default_factory=dict)
    """Why a recording was not added, by name."""
    remarks: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """What was noticed or done to a recording, by id."""


def add(
    corpus: Corpus,
    paths: Iterable[str | Path],
    about: Mapping[str, Any] | None = None,
    *,
    listed: Mapping[str, Mapping[str, Any]] | None = None,
    texts: Mapping[str, str] | None = None,
    phones: Path | None = None,
    speaker: str | None = None,
    language: str | None = None,
    transcriber: Path | None = None,
    emotions: Path | None = None,
    face: int | None = None,
    placing: bool = True,
    replacing: bool = False,
    workers: Workers = ALONE,
) -> AddReport:
    """Add every recording in files and folders; those that cannot be used are named with the reason, the others added.

    about: fields of `Record` that hold for every recording; listed: fields that hold instead for the recordings of
    these names; texts: what is said, by name (else the tables among the files say it). phones, emotions: files of the
    one recording that is added. speaker: whose phones are taken of files that hold those of several. language: of the
    texts; found out otherwise. transcriber: folder of a model that writes down what nobody did. face: which one is captured
    from video with several, counted from the left. placing: whether phones are placed where none are given; methods that hear
    the sound alone need none, and `align` places them later. workers: who reads, captures and aligns; the corpus is the same
    whoever does.

    Recordings that are there already are passed over, so an interrupted run can be repeated. Of those of which something
    is given otherwise than before only that is done anew; what is not given this time stays, and so do phones that were
    corrected by hand, and recordings of the same name from another folder, unless `replacing`.
    """
    paths = list(paths)
    recordings, refused = find_recordings(paths)
    about = about or {}
    if len(recordings) > 1 and ("id" in about or about.get("text") or phones or emotions):
        raise FacesynthError(f"id, text, phones and emotions fit one recording, but there are {len(recordings)}; use a list")
    tables = read_tables(find_tables(paths), texts, listed)
    givens = []
    for found in recordings:
        recording = replace(found, phones=phones or found.phones, emotions=emotions or found.emotions)
        recording = replace(recording, speaker=speaker, language=language, transcriber=transcriber, placed=placing)
        facts = {**about, **(listed or {}).get(recording.name, {})}
        try:
            givens.append(_given(recording, facts, tables.texts, face))
        except FacesynthError as error:
            refused[recording.name] = str(error)
    report = _written(corpus, givens, {**refused, **tables.refused}, replacing, workers)
    report = replace(report, remarks={**report.remarks, **tables.remarks({recording.name for recording in recordings})})
    write_account(corpus, givens, paths, report)
    return report


def _given(recording: Recording, facts: Mapping[str, Any], texts: Mapping[str, str], face: int | None) -> Given:
    """A recording with what is known of it: its words are those stated for it, else of a table, else of a file beside it."""
    utterance_id = check_id(str(facts.get("id", recording.name)))
    stated = {name: value for name, value in facts.items() if name != "id"}
    text = stated.get("text") or texts.get(recording.name) or (words_of(recording.text) if recording.text else "")
    return Given(recording, utterance_id, {**stated, "text": text} if text else stated, face)


def _written(corpus: Corpus, givens: Sequence[Given], refused: Mapping[str, str], replacing: bool, workers: Workers) -> AddReport:
    """Prepare recordings by the workers; write them one after the other, in order, in this one."""
    report = AddReport(refused=refused)
    tasks = [(corpus.subset([given.id] if given.id in corpus else []), given, replacing) for given in givens]
    for given, result in zip(givens, spread(attempt, tasks, workers, "adding"), strict=True):
        try:
            if isinstance(result, FacesynthError):
                raise result
            is_new = given.id not in corpus
            if result is not None:
                _write(corpus, result)
        except FacesynthError as error:
            report = replace(report, refused={**report.refused, given.recording.name: str(error)})
            continue
        report = _noted(report, given.id, result, is_new)
    return report


def _write(corpus: Corpus, prepared: Prepared) -> None:
    record, speech, motion = prepared.record, prepared.speech, prepared.motion
    if record.id not in corpus and motion is not None:
        corpus.add_utterance(record, speech, motion, prepared.words, aligned=prepared.aligned)
        return
    corpus.change_utterance(record, speech, motion, prepared.words, parts=prepared.parts, aligned=prepared.aligned)


def _noted(report: AddReport, name: str, prepared: Prepared | None, is_new: bool) -> AddReport:
    """The report with what became of one more recording."""
    if prepared is None:
        return replace(report, unchanged=(*report.unchanged, name))
    remarks = {**report.remarks, name: prepared.remarks} if prepared.remarks else report.remarks
    report = replace(report, remarks=remarks)
    if is_new:
        return replace(report, added=(*report.added, name))
    if prepared.kept:
        report = replace(report, kept={**report.kept, name: prepared.kept})
    if prepared.changed or prepared.parts:
        what = prepared.changed or tuple(f"{part} (was lost)" for part in sorted(prepared.parts))
        return replace(report, changed={**report.changed, name: what})
    return report if prepared.kept else replace(report, unchanged=(*report.unchanged, name))
