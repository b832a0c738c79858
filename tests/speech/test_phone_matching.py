"""Rows of phones laid beside each other, against a literal version of the recursion; and passages that one of them lacks."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from facesynth.inference.phones import PHONES, VOWELS, viseme_of
from facesynth.inference.spikes import Spike
from facesynth.speech import recognition
from facesynth.speech.passages import follow
from facesynth.speech.phone_matching import MISSED, PASSAGE, PASSED, match
from facesynth.speech.pronunciation import pronounce
from facesynth.speech.transcript import words_of

RATE = 16000
STEP_S = 0.08
WORDS = words_of(
    "morning letter captain river yellow garden promise window silver market number finger mountain paper doctor kitchen"
    " summer button castle weather engine pencil teacher bottle island winter orange basket candle village"
)


def worth(a, b):
    if a == b:
        return 20
    if viseme_of(a) == viseme_of(b):
        return 8
    return 0 if {a, b} <= VOWELS else -20


def literal(written, heard):
    """The best score by the recursion as it is written down."""

    @cache
    def passage(i, j):
        return -(10**9) if i == 0 else max(passage(i - 1, j), best(i - 1, j) - PASSAGE) - PASSED

    @cache
    def best(i, j):
        if i == j == 0:
            return 0
        ways = [passage(i, j)]
        ways += [best(i - 1, j - 1) + worth(written[i - 1], heard[j - 1])] if i and j else []
        ways += [best(i - 1, j) - MISSED] if i else []
        ways += [best(i, j - 1) - MISSED] if j else []
        return max(ways + [best(i, k) - PASSAGE - PASSED * (j - k) for k in range(j)])

    return best(len(written), len(heard))


def score_of(found, written, heard):
    """What a found way is worth, told by what it says of each phone."""
    total = -MISSED * int(((found.partners < 0) & ~found.unsaid).sum())
    total += sum(worth(written[i], heard[j]) for i, j in enumerate(found.partners) if j >= 0)
    taken = np.isin(np.arange(len(heard)), found.partners)
    total -= MISSED * int((~taken & ~found.unwritten).sum())
    for marked in (found.unsaid, found.unwritten):
        total -= PASSAGE * int((np.diff(marked.astype(int), prepend=0) == 1).sum()) + PASSED * int(marked.sum())
    return total


@pytest.mark.parametrize("seed", range(8))
def test_the_way_that_is_found_is_the_best(seed):
    rng = np.random.default_rng(seed)
    written = [PHONES[k] for k in rng.integers(1, 6 if seed % 2 else len(PHONES), rng.integers(1, 30))]
    heard = list(written[: len(written) // 2]) + [PHONES[k] for k in rng.integers(1, 6, rng.integers(0, 30))]
    heard += written[len(written) // 2 + (seed % 3) * 4 :]
    found = match(written, heard)
    order = found.partners[found.partners >= 0]
    assert (np.diff(order) > 0).all()
    assert not found.unwritten[order].any()
    assert score_of(found, written, heard) == literal(tuple(written), tuple(heard))


def said(words, rng, wrong=0.2):
    """Spikes of words that are heard as the network hears them, and each word's first second."""
    spikes, starts_s, now_s = [], [], 0.2
    for word in words:
        starts_s.append(now_s)
        for phone in pronounce(word):
            what = rng.random()
            if what >= wrong / 4:
                other = PHONES[rng.integers(1, len(PHONES))]
                spikes.append(Spike(other if what < wrong else phone, now_s, now_s, 0.8, False))
            now_s += STEP_S
        now_s += 0.3 if rng.random() < 0.2 else 0.0
    return spikes, np.array([*starts_s, now_s])


def drawn(rng, count):
    return [WORDS[k] for k in rng.integers(0, len(WORDS), count)]


def silence(spikes):
    return np.zeros(round((spikes[-1].last_s + 0.5) * RATE), np.float32)


@pytest.mark.parametrize(("count", "first", "missing"), [(120, 50, 15), (120, 0, 10), (120, 110, 10), (500, 300, 40)])
def test_a_passage_that_the_transcript_lacks_is_found(count, first, missing):
    rng = np.random.default_rng(count + first)
    words = drawn(rng, count)
    spikes, starts_s = said(words, rng)
    written = words[:first] + words[first + missing :]
    found = follow(silence(spikes), RATE, written, spikes)
    assert not found.unsaid
    assert [word for passage in found.passages for word in passage.words] == written
    (lacking,) = (passage for passage in found.passages if not passage.words)
    assert lacking.start_s == pytest.approx(starts_s[first] if first else 0.0, abs=1.2)
    assert lacking.end_s == pytest.approx(starts_s[first + missing], abs=1.2)
    assert found.passages[0].start_s == 0.0
    assert all(before.end_s == after.start_s for before, after in zip(found.passages, found.passages[1:], strict=False))


@pytest.mark.parametrize(("count", "first", "extra"), [(120, 60, 15), (120, 0, 10), (120, 120, 10), (500, 300, 40)])
def test_a_passage_that_the_sound_lacks_is_found(count, first, extra):
    rng = np.random.default_rng(count + first)
    words, more = (
        drawn(rng, count),
        words_of("my grandmother kept blue parrots and every evening they sang to neighbours until " * 8),
    )
    spikes, starts_s = said(words, rng)
    found = follow(silence(spikes), RATE, words[:first] + list(more[:extra]) + words[first:], spikes)
    (missing,) = found.unsaid
    assert len(set(missing.words) ^ set(more[:extra])) <= 2
    assert missing.at_s == pytest.approx(starts_s[first] if first else 0.0, abs=1.2)
    assert all(passage.words for passage in found.passages)


def test_a_passage_in_place_of_another_and_another_text():
    rng = np.random.default_rng(5)
    words, others = drawn(rng, 100), words_of("she thought of boats that go by and how he would shout hello from each of them")
    spikes, starts_s = said(words, rng)
    found = follow(silence(spikes), RATE, [*words[:40], *others, *words[60:]], spikes)
    (missing,) = found.unsaid
    assert set(others) - set(missing.words) <= set(others[:1] + others[-1:])
    lacking = max((passage for passage in found.passages if not passage.words), key=lambda one: one.end_s - one.start_s)
    assert lacking.start_s == pytest.approx(starts_s[40], abs=1.2)
    assert lacking.end_s == pytest.approx(starts_s[60], abs=1.2)
    assert follow(silence(spikes), RATE, list(others) * 6, spikes) is None


@pytest.mark.parametrize(("share", "believed"), [(0.1, True), (0.3, False)])
def test_a_fit_far_from_where_phones_are_heard_is_not_believed(monkeypatch, share, believed):
    heard = [Spike("t", 0.1 * k, 0.1 * k + 0.02, 0.9, k % 3 == 0) for k in range(1, 21)]
    near = [(spike.phone, spike.first_s, spike.last_s) for spike in heard]
    moved = [
        (label, start + 0.06 * (k < 20 * share), stop + 0.06 * (k < 20 * share)) for k, (label, start, stop) in enumerate(near)
    ]
    monkeypatch.setattr(recognition, "fit_phones", lambda *_: SimpleNamespace(phones=tuple(moved)))
    found = recognition._fitted(np.zeros(40000, np.float32), 16000, heard, near)
    assert found == (moved if believed else near)
