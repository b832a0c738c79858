from dataclasses import dataclass, replace

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.corpus import Corpus
from facesynth.corpus.align import align
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import PhoneTrack


@dataclass(frozen=True)
class Placed:
    phones: PhoneTrack
    words: tuple = ()
    warnings: tuple = ("a guess",)


@pytest.fixture
def aligner(monkeypatch):
    """An aligner that finds one vowel in everything but what says 'nonsense'."""

    def place(audio, rate, text):
        if "nonsense" in text:
            raise FacesynthError("the transcript does not match")
        duration_s = len(audio) / rate
        return Placed(PhoneTrack(("pau", "aa", "pau"), np.array([0.1, duration_s - 0.1, duration_s])))

    monkeypatch.setattr("facesynth.speech.phone_sources.align", place)


@pytest.fixture
def corpus(tmp_path, aligner):
    """Four utterances: phones by an aligner; by hand; without text; with a wrong text."""
    corpus = tiny_corpus(tmp_path / "tiny", 4)
    align(corpus, [corpus.ids[0]], force=True)
    corpus.update(replace(corpus.record(corpus.ids[2]), text=""))
    corpus.update(replace(corpus.record(corpus.ids[3]), text="nonsense"))
    return Corpus.open(corpus.path)


def phones(corpus, number):
    return corpus[corpus.ids[number]].speech.phones.labels


def test_only_what_a_program_placed_is_placed_anew(corpus):
    before = [phones(corpus, number) for number in range(4)]
    report = align(corpus)
    assert report.aligned == (corpus.ids[0],)
    assert list(report.kept) == [corpus.ids[1], corpus.ids[2], corpus.ids[3]]
    assert "by hand" in report.kept[corpus.ids[1]]
    assert "no text" in report.kept[corpus.ids[2]]
    assert report.warnings == {corpus.ids[0]: ("a guess",)}
    assert [phones(corpus, number) for number in range(4)] == before


def test_a_correction_is_kept_until_forced(corpus):
    grid = corpus.files.phones(corpus.ids[0])
    grid.write_text(grid.read_text(encoding="utf-8").replace('"aa"', '"iy"'), encoding="utf-8")
    assert align(corpus).aligned == ()
    assert phones(corpus, 0) == ("pau", "iy", "pau")
    report = align(corpus, force=True)
    assert report.aligned == corpus.ids[:2]
    assert report.failed == {corpus.ids[3]: "the transcript does not match"}
    assert phones(corpus, 0) == phones(corpus, 1) == ("pau", "aa", "pau")
    assert phones(corpus, 3) != ("pau", "aa", "pau"), "what failed stays as it was"
    assert align(Corpus.open(corpus.path)).aligned == corpus.ids[:2]


def test_a_lost_textgrid_is_made_again(corpus):
    corpus.files.phones(corpus.ids[1]).unlink()
    assert corpus.ids[1] in align(corpus).aligned
    assert phones(corpus, 1) == ("pau", "aa", "pau")


def test_an_unknown_utterance_is_refused(corpus):
    with pytest.raises(FacesynthError, match="unknown utterance"):
        align(corpus, ["nobody"])
