import pytest
from hypothesis import given
from hypothesis import strategies as st

from facesynth.corpus.record import Record
from facesynth.corpus.splits import fold_ids, split_ids
from facesynth.inference.errors import FacesynthError

RECORDS = [
    Record(f"s{s}_{e}_{t}", sentence=f"s{s}", emotion=e, take=t) for s in range(10) for e in ("neutral", "sad") for t in (1, 2)
]


def sentences(ids):
    return {utterance_id.split("_")[0] for utterance_id in ids}


@given(st.integers(0, 1000), st.floats(0.01, 0.99))
def test_no_sentence_is_on_both_sides_and_all_are_somewhere(seed, share):
    train, test = split_ids(RECORDS, seed, share)
    assert not sentences(train) & sentences(test)
    assert sorted([*train, *test]) == sorted(record.id for record in RECORDS)
    assert train
    assert test


def test_the_share_and_the_seed_count():
    assert len(sentences(split_ids(RECORDS, 0, 0.3)[1])) == 3
    assert split_ids(RECORDS, 5, 0.3) == split_ids(RECORDS, 5, 0.3)
    assert len({tuple(split_ids(RECORDS, seed, 0.3)[1]) for seed in range(10)}) > 3
    assert split_ids(RECORDS, 5, 0.3) == split_ids(RECORDS[::-1], 5, 0.3) or sentences(
        split_ids(RECORDS, 5, 0.3)[1]
    ) == sentences(split_ids(RECORDS[::-1], 5, 0.3)[1])


def test_the_column_wins_where_it_is_filled():
    marked = [Record(r.id, sentence=r.sentence, split="test" if r.sentence in ("s3", "s7") else "train") for r in RECORDS]
    for seed in range(3):
        assert sentences(split_ids(marked, seed, 0.5)[1]) == {"s3", "s7"}
    partly = [Record(r.id, sentence=r.sentence, split="test" if r.id == "s3_sad_1" else "") for r in RECORDS]
    tested = sentences(split_ids(partly, 0, 0.4)[1])
    assert "s3" in tested
    assert len(tested) == 4


def test_a_sentence_marked_for_both_sides_is_refused():
    with pytest.raises(FacesynthError, match="'a' is put on both sides"):
        split_ids([Record("x", sentence="a", split="test"), Record("y", sentence="a", split="train"), Record("z")], 0, 0.5)


def test_everything_marked_for_one_side_is_refused():
    for side, other in (("test", "train"), ("train", "test")):
        with pytest.raises(FacesynthError, match=f"nothing to {other} on"):
            split_ids([Record("x", split=side), Record("y", split=side)], 0, 0.5)


def test_without_names_of_sentences_the_words_decide():
    records = [Record("a", "Hello, World!"), Record("b", "hello world"), Record("c", "Good-bye"), Record("d")]
    for seed in range(8):
        train, test = split_ids(records, seed, 0.5)
        assert ("a" in train) == ("b" in train)
        assert len(train) + len(test) == 4


def test_every_sentence_is_tested_on_once():
    folds = fold_ids(RECORDS, 3, seed=1)
    tested = [sentence for _, test in folds for sentence in sentences(test)]
    assert sorted(tested) == sorted({record.sentence for record in RECORDS})
    for train, test in folds:
        assert not sentences(train) & sentences(test)
        assert len(train) + len(test) == len(RECORDS)
    assert folds == fold_ids(RECORDS, 3, seed=1)


def test_too_little_to_split():
    with pytest.raises(FacesynthError, match="two different sentences"):
        split_ids([Record("a", sentence="s"), Record("b", sentence="s")], 0, 0.5)
    with pytest.raises(FacesynthError, match="share"):
        split_ids(RECORDS, 0, 1)
    with pytest.raises(FacesynthError, match="10 sentences"):
        fold_ids(RECORDS, 11, 0)
