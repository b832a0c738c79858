"""Splits by sentence: what is tested on was never heard in training, in no emotion and no take."""

from collections.abc import Iterable, Mapping

import numpy as np

from facesynth.corpus.record import Record
from facesynth.inference.errors import FacesynthError


def by_sentence(records: Iterable[Record]) -> dict[str, list[Record]]:
    """Records by sentence, sentences in alphabetical order."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record.sentence_key, []).append(record)
    return dict(sorted(groups.items()))


def split_ids(records: Iterable[Record], seed: int, test_share: float) -> tuple[list[str], list[str]]:
    """Ids to train on and to test on.

    A sentence goes where the `split` column puts it; the others are drawn so that about `test_share` of all sentences
    are tested on, at least one.
    """
    if not 0 < test_share < 1:
        raise FacesynthError(f"the share to test on must lie between 0 and 1; got {test_share}")
    groups = by_sentence(records)
    if len(groups) < 2:
        raise FacesynthError(f"a split needs at least two different sentences; this corpus has {len(groups)}: record more")
    placed = {sentence: _stored_split(sentence, group) for sentence, group in groups.items()}
    free = [sentence for sentence, split in placed.items() if not split]
    tested = {sentence for sentence, split in placed.items() if split == "test"}
    wanted = min(max(round(test_share * len(groups)), 1) - len(tested), len(free) - (len(tested) + len(free) == len(groups)))
    tested.update(np.random.default_rng(seed).permutation(np.array(free, object))[: max(wanted, 0)])
    if not tested or len(tested) == len(groups):
        raise FacesynthError(
            "the split column leaves nothing to " + ("train" if tested else "test") + " on; change it in utterances.csv"
        )
    return _ids(groups, set(groups) - tested), _ids(groups, tested)


def fold_ids(records: Iterable[Record], k: int, seed: int) -> list[tuple[list[str], list[str]]]:
    """Pairs (k of them) of ids to train on and to test on; every sentence is tested on once. Stored splits are passed over."""
    groups = by_sentence(records)
    if not 2 <= k <= len(groups):
        raise FacesynthError(f"the number of folds must lie between 2 and the {len(groups)} sentences of the corpus; got {k}")
    shuffled = np.random.default_rng(seed).permutation(np.array(list(groups), object))
    parts = [set(part) for part in np.array_split(shuffled, k)]
    return [(_ids(groups, set(groups) - part), _ids(groups, part)) for part in parts]


def _stored_split(sentence: str, group: list[Record]) -> str:
    splits = {record.split for record in group} - {""}
    if len(splits) > 1:
        ids = ", ".join(record.id for record in group[:6])
        raise FacesynthError(f"sentence {sentence!r} is put on both sides of the split ({ids}); a sentence belongs on one side")
    return splits.pop() if splits else ""


def _ids(groups: Mapping[str, list[Record]], sentences: set[str]) -> list[str]:
    return [record.id for sentence, group in groups.items() if sentence in sentences for record in group]
