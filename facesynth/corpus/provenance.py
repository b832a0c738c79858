"""What a saved model states of the recordings that it learned from."""

import hashlib
import json
from collections.abc import Iterable
from typing import Any

from facesynth.corpus.files import Files
from facesynth.corpus.header import FORMAT, Header
from facesynth.corpus.journal import Journal
from facesynth.corpus.record import Record
from facesynth.hashing import hash_file
from facesynth.inference.errors import FacesynthError


def provenance(files: Files, header: Header, records: Iterable[Record]) -> dict[str, Any]:
    """Performer, licences, consents, size and hash of the utterances in `records`, as plain JSON values."""
    records, edits = sorted(records, key=lambda record: record.id), Journal(files.journal).sum()
    return {
        "performer": header.performer,
        "synthetic": header.synthetic,
        "utterances": len(records),
        "minutes": round(sum(duration_s(files, record.id) for record in records) / 60, 3),
        "fps": header.fps,
        "emotions": list(header.emotions),
        "licences": sorted({record.licence or header.licence for record in records}),
        "consents": sorted({record.consent or header.consent for record in records}),
        "corpus_format": FORMAT,
        "removed_nodes": len(edits.removed),
        "drawn_nodes": len(edits.added),
        "sha256": content_hash(files, header, records),
    }


def duration_s(files: Files, utterance_id: str) -> float:
    """Length of an utterance's sound, seconds, from the head of its file alone."""
    import soundfile

    path = files.audio(utterance_id)
    try:
        return float(soundfile.info(path).duration)
    except (soundfile.LibsndfileError, RuntimeError) as error:
        raise FacesynthError(f"{path} is missing or no sound ({error}); see `facesynth corpus check`") from None


def content_hash(files: Files, header: Header, records: Iterable[Record]) -> str:
    """sha256 over everything that a method could learn from: signals, phones, emotions, edits, but no remarks."""
    facts = [header.performer, header.layout.to_dict(), header.fps, list(header.emotions)]
    digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode())
    for record in records:
        digest.update(json.dumps([record.id, record.sentence_key, record.emotion, record.intensity, record.take]).encode())
        for path in (files.audio(record.id), files.phones(record.id), files.motion(record.id), files.emotions(record.id)):
            digest.update(hash_file(path).encode() if path.is_file() else b"none")
    digest.update(hash_file(files.journal).encode() if files.journal.is_file() else b"none")
    return digest.hexdigest()
