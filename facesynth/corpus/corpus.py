"""A performer's recordings on disk."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import ArrayLike, NDArray

from facesynth.corpus.files import Files
from facesynth.corpus.header import Header, read_header, write_header
from facesynth.corpus.journal import ADDED, AddedNode, Edit, Journal, node_name, parse_node
from facesynth.corpus.provenance import duration_s, provenance
from facesynth.corpus.record import Record, read_records, write_records
from facesynth.corpus.signals import (
    PARTS,
    Part,
    hash_signals,
    lost_parts,
    read_motion,
    read_utterance,
    write_signals,
)
from facesynth.corpus.splits import fold_ids, split_ids
from facesynth.corpus.utterance import Utterance
from facesynth.hashing import hash_file
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Layout
from facesynth.inference.long_arrays import row_blocks
from facesynth.inference.motion import Motion
from facesynth.inference.phones import PHONES, SILENCE
from facesynth.inference.speech import Speech
from facesynth.motion.gaps import GapReport
from facesynth.speech.segments import Segment
from facesynth.speech.textgrid import read_textgrid

LOCK_TIMEOUT_S = 60.0


@dataclass(frozen=True, eq=False)
class MotionArrays:
    """The motion of many utterances as one struct of arrays."""

    frames: NDArray[np.float32]
    """[N, C] the frames of all, one utterance after the other; NaN where samples are missing."""
    range_starts: NDArray[np.int64]
    """[U] first frame of each utterance."""
    range_stops: NDArray[np.int64]
    """[U] one past its last frame."""
    ids: tuple[str, ...]


class Corpus:
    """Utterances in a folder, opened lazily: `len`, `ids`, iteration and `corpus[id]`.

    `len`, `ids` and iteration pass over what is marked unusable; `records` and `corpus[id]` do not. The order is that of
    the ids. A subset is a view of the same folder.
    """

    def __init__(self, path: Path, header: Header, records: Mapping[str, Record]) -> None:
        self.path = path
        self.header = header
        self.files = Files(path)
        self._records = dict(sorted(records.items()))

    @classmethod
    def create(
        cls,
        path: str | Path,
        *,
        performer: str,
        layout: Layout,
        fps: float,
        emotions: Sequence[str],
        synthetic: bool = False,
        licence: str = "",
        consent: str = "",
        notes: str = "",
    ) -> Self:
        """Make a folder a corpus without utterances; FacesynthError where one is already."""
        files = Files(Path(path))
        header = Header(performer, layout, float(fps), tuple(emotions), synthetic, licence, consent, notes)
        if files.header.exists():
            raise FacesynthError(f"{path} is a corpus already; open it, or choose another folder")
        if files.records.exists():
            raise FacesynthError(f"{files.records} exists, but no corpus.yaml beside it; move it away or choose another folder")
        files.root.mkdir(parents=True, exist_ok=True)
        write_header(files.header, header)
        write_records(files.records, ())
        return cls.open(path)

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Open a corpus folder; FacesynthError for anything else."""
        files = Files(Path(path))
        header = read_header(files.header)
        return cls(files.root, header, read_records(files.records) if files.records.exists() else {})

    @property
    def performer(self) -> str:
        """The performer's name."""
        return self.header.performer

    @property
    def layout(self) -> Layout:
        """What the channels of the motion are."""
        return self.header.layout

    @property
    def fps(self) -> float:
        """Rate of the motion, Hz."""
        return self.header.fps

    @property
    def emotions(self) -> tuple[str, ...]:
        """The emotions that the corpus distinguishes."""
        return self.header.emotions

    @property
    def synthetic(self) -> bool:
        """Whether nobody was recorded."""
        return self.header.synthetic

    @property
    def notes(self) -> str:
        """Remarks of whoever made the corpus."""
        return self.header.notes

    @property
    def records(self) -> tuple[Record, ...]:
        """Every utterance, usable or not."""
        return tuple(self._records.values())

    @property
    def usable_records(self) -> tuple[Record, ...]:
        """Utterances that are not marked unusable."""
        return tuple(record for record in self.records if record.usable)

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the usable utterances."""
        return tuple(record.id for record in self.usable_records)

    def __len__(self) -> int:
        return len(self.usable_records)

    def __iter__(self) -> Iterator[Utterance]:
        return (self[utterance_id] for utterance_id in self.ids)

    def __contains__(self, utterance_id: object) -> bool:
        return utterance_id in self._records

    def __getitem__(self, utterance_id: str) -> Utterance:
        return self.read(utterance_id)[0]

    def __repr__(self) -> str:
        kind = "synthetic " if self.synthetic else ""
        return f"<Corpus {str(self.path)!r}: {len(self)} {kind}utterances of {self.performer}>"

    def record(self, utterance_id: str) -> Record:
        """What is known of an utterance beside its signals."""
        if utterance_id not in self._records:
            raise unknown("utterance", utterance_id, self._records)
        return self._records[utterance_id]

    def read(self, utterance_id: str) -> tuple[Utterance, GapReport]:
        """An utterance, short gaps filled, with the account of its gaps."""
        return read_utterance(self.files, self.header, self.record(utterance_id))

    def raw_motion(self, utterance_id: str) -> Motion:
        """An utterance's motion as it was recorded, all gaps NaN."""
        return read_motion(self.files.motion(self.record(utterance_id).id), self.header)

    def duration_s(self, utterance_id: str) -> float:
        """Length of an utterance's sound, seconds."""
        return duration_s(self.files, self.record(utterance_id).id)

    def subset(self, ids: Iterable[str]) -> "Corpus":
        """A view of some utterances."""
        return Corpus(self.path, self.header, {utterance_id: self.record(utterance_id) for utterance_id in ids})

    def split(self, seed: int = 0, test_share: float = 0.2) -> "tuple[Corpus, Corpus]":
        """Views to train on and to test on, by sentence; the `split` column wins where it is filled."""
        train, test = split_ids(self.usable_records, seed, test_share)
        return self.subset(train), self.subset(test)

    def folds(self, k: int, seed: int = 0) -> "list[tuple[Corpus, Corpus]]":
        """Pairs (k of them) of views to train on and to test on, by sentence; every sentence is tested on once."""
        return [(self.subset(train), self.subset(test)) for train, test in fold_ids(self.usable_records, k, seed)]

    def arrays(self) -> MotionArrays:
        """The motion of all usable utterances, concatenated."""
        tracks = [utterance.motion.frames for utterance in self]
        stops = np.cumsum([len(track) for track in tracks], dtype=np.int64)
        frames = np.concatenate([np.zeros((0, self.layout.channels), np.float32), *tracks])
        return MotionArrays(frames, np.concatenate([[0], stops[:-1]]).astype(np.int64)[: len(tracks)], stops, self.ids)

    def provenance(self) -> dict[str, Any]:
        """What a saved model states of its recordings: performer, licences, consents, size, hash."""
        return provenance(self.files, self.header, self.usable_records)

    def add_utterance(
        self, record: Record, speech: Speech, motion: Motion, words: Sequence[Segment] = (), *, aligned: bool = False
    ) -> Record:
        """Write an utterance's files and then its line in utterances.csv; returns the record as it was kept.

        aligned: whether a program placed the phones, so that `align` may place them anew. Interrupted at any moment,
        the corpus holds what it held. Adding the same sound and motion under the same id again changes nothing,
        whatever was corrected by hand since; another recording under that id is refused.
        """
        self._check_fits(record, speech)
        self._check_motion(record, motion)
        record = replace(record, source_hash=hash_signals(speech.audio, speech.sample_rate, motion))
        with self._writing() as records:
            old = _same_name(record.id, records)
            if old and (old.id != record.id or old.source_hash != record.source_hash):
                raise FacesynthError(f"{self.path} has another recording called {old.id!r}; give this one another id")
            parts = PARTS if old is None else lost_parts(self.files, record.id)
            records[record.id] = self._write(old or record, speech, motion, words, parts, aligned)
        self._remember(records[record.id])
        return records[record.id]

    def change_utterance(
        self,
        record: Record,
        speech: Speech,
        motion: Motion | None = None,
        words: Sequence[Segment] = (),
        *,
        parts: Collection[Part],
        aligned: bool = False,
    ) -> Record:
        """Write some files of an utterance anew and then its line; interrupted at any moment, it can be done again.

        motion: needed where it is among the parts. aligned: whether a program placed the phones, if they are among them.
        """
        self.record(record.id)
        self._check_fits(record, speech)
        if motion is not None:
            self._check_motion(record, motion)
            record = replace(record, source_hash=hash_signals(speech.audio, speech.sample_rate, motion))
        with self._writing() as records:
            records[record.id] = self._write(record, speech, motion, words, parts, aligned)
        self._remember(records[record.id])
        return records[record.id]

    def _write(
        self,
        record: Record,
        speech: Speech,
        motion: Motion | None,
        words: Sequence[Segment],
        parts: Collection[Part],
        aligned: bool,
    ) -> Record:
        write_signals(self.files, record, speech, motion, words, parts)
        if "phones" not in parts:
            return record
        return replace(record, aligned_hash=hash_file(self.files.phones(record.id)) if aligned else "")

    def update(self, record: Record) -> None:
        """Replace an utterance's line in utterances.csv."""
        self.record(record.id)
        self._check_emotion(record.emotion)
        with self._writing() as records:
            records[record.id] = record
        self._remember(record)

    @property
    def journal(self) -> Journal:
        """Edits of nodes, never destructive."""
        return Journal(self.files.journal)

    def without_phones(self) -> tuple[str, ...]:
        """Usable utterances of which nobody knows what is said."""
        grids = ((record.id, self.files.phones(record.id)) for record in self.usable_records)
        return tuple(name for name, path in grids if path.is_file() and not read_textgrid(path)[0].known)

    def removed_nodes(self) -> frozenset[str]:
        """Names of nodes that a person removed."""
        return self.journal.removed()

    def added_nodes(self) -> tuple[AddedNode, ...]:
        """Nodes that a person added."""
        return self.journal.added()

    def remove_node(self, name: str) -> None:
        """Remove a node (`utterance_id:phone_number`, or an added one); the recording stays as it is."""
        name = self.known_node(name)
        with self._lock():
            self.journal.remove(name)

    def restore_node(self, name: str) -> None:
        """Take back that a node was removed."""
        name = self.known_node(name)
        with self._lock():
            self.journal.restore(name)

    def known_node(self, name: str) -> str:
        """The name of a node of this corpus, removed or not, as it is written; FacesynthError for any other."""
        utterance_id, number = parse_node(name)
        if utterance_id == ADDED:
            known = [node.name for node in self.added_nodes()]
        else:
            phones, _ = read_textgrid(self.files.phones(self.record(utterance_id).id))
            known = [node_name(utterance_id, i) for i in range(len(phones))]
        name = node_name(utterance_id, number)
        if name not in known and name not in self.removed_nodes():
            raise unknown("node", name, known)
        return name

    def add_node(self, phone: str, emotion: str, frames: ArrayLike, title: str = "") -> AddedNode:
        """Add a node: the motion [L, C] of one phone in one emotion, at the corpus's rate."""
        motion = Motion(np.asarray(frames, np.float32), self.fps, self.layout)
        if not len(motion) or not np.isfinite(motion.frames).all():
            raise FacesynthError("an added node needs at least one frame and no missing samples")
        if phone not in PHONES or phone == SILENCE:
            raise unknown("phone", phone, [known for known in PHONES if known != SILENCE])
        self._check_emotion(emotion)
        with self._lock():
            return self.journal.add(phone, emotion, motion.frames, title)

    def undo(self) -> Edit:
        """Take back the newest edit of a node."""
        with self._lock():
            return self.journal.undo()

    def _check_emotion(self, emotion: str) -> None:
        if emotion not in self.emotions:
            raise unknown("emotion", emotion, self.emotions)

    def _check_fits(self, record: Record, speech: Speech) -> None:
        for emotion in {record.emotion, *speech.emotions.labels}:
            self._check_emotion(emotion)
        for phone in speech.phones.labels:
            if phone not in PHONES:
                raise unknown("phone", phone, PHONES)

    def _check_motion(self, record: Record, motion: Motion) -> None:
        if (motion.layout.kind, motion.layout.names) != (self.layout.kind, self.layout.names):
            raise FacesynthError(f"the motion of {record.id!r} has another layout than the corpus")
        if not np.isclose(motion.fps, self.fps, rtol=1e-6):
            raise FacesynthError(
                f"the motion of {record.id!r} runs at {motion.fps:g} fps, the corpus at {self.fps:g}: resample it"
            )
        if not len(motion) or any(np.isinf(motion.frames[rows]).any() for rows in row_blocks(motion.frames)):
            raise FacesynthError(f"the motion of {record.id!r} is empty or holds infinite values")

    def _remember(self, record: Record) -> None:
        self._records = dict(sorted({**self._records, record.id: record}.items()))

    @contextmanager
    def _writing(self) -> Iterator[dict[str, Record]]:
        """The records on disk, to be changed; written back, if they changed, when the block ends well."""
        with self._lock():
            records = read_records(self.files.records) if self.files.records.exists() else {}
            before = dict(records)
            yield records
            if records != before:
                write_records(self.files.records, records.values())

    @contextmanager
    def _lock(self) -> Iterator[None]:
        try:
            with FileLock(self.files.lock, timeout=LOCK_TIMEOUT_S):
                yield
        except Timeout:
            raise FacesynthError(f"another program has been writing to {self.path} for a minute; wait until it is done") from None


def _same_name(utterance_id: str, records: Mapping[str, Record]) -> Record | None:
    """A record whose files would be called the same on a system that does not tell cases apart."""
    folded = utterance_id.casefold()
    return records.get(utterance_id) or next((r for r in records.values() if r.id.casefold() == folded), None)
