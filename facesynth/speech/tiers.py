"""Which tiers of a TextGrid hold the phones and the words, and whose they are; intervals made to follow one another."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.speech.phone_labels import QUIET, Notation, normalise_phone, notation_of
from facesynth.speech.praat import Grid, Tier
from facesynth.speech.segments import Segment

_PHONES = re.compile(r"phone(?:me|mic|tic)?s?|(?<![a-z])ph(?:n|on)?s?(?![a-z])|(?<![a-z])phonalign|^mau(?![a-z])")
_WORDS = re.compile(r"words?|(?<![a-z])tokensalign|^ort(?:-mau)?(?![a-z])|(?<![a-z])orthograph(?:y|ic)")
"""As the Montreal aligner, ELAN, WebMAUS and SPPAS call them."""
_CONFIDENCES = re.compile(r"confidences?")
_BETWEEN = " \t\u00a0\u202f-\u2010\u2011\u2012\u2013\u2014\u2212_@:\uff1a./|#,;&+=~\u00b7\u30fb"
"""Between the name of a speaker and that of a kind of tier."""
_EMPTY_BRACKETS = re.compile(r"[(\[{<]\s*[)\]}>]")
"""What is left of `Anna (phones)`."""

NO_LENGTH_S = 1e-6
LARGEST_OVERLAP_S = 0.01
"""Neighbours that overlap by more were not meant to touch."""
TOLD_S = 1e-9
"""Below this an overlap is the rounding of the last digit."""


SHARE_OF_PHONES = 0.8
"""A tier without a name that says so holds phones if as many of its different labels are such."""


class SpeakerTiers(NamedTuple):
    """What a TextGrid holds of one speaker."""

    phones: Tier
    words: Tier | None
    confidences: Tier | None
    """How sure each phone is, as numbers."""
    remarks: tuple[str, ...]
    """What a person should know."""


def tiers_of(grid: Grid, path: Path, speaker: str | None) -> SpeakerTiers:
    """The tiers of the speaker, where there are several, and what a person should know.

    FacesynthError where there are no phones, or those of several speakers of which none was chosen.
    """
    spoken = _without_empty(_by_speaker(grid.tiers, _PHONES))
    by_labels = None if spoken else _by_labels(grid.tiers)
    if by_labels:
        words = next((tier for tier in grid.tiers if tier is not by_labels and _WORDS.search(tier.name.lower())), None)
        name = repr(by_labels.name) if by_labels.name else "the one without a name"
        return SpeakerTiers(by_labels, words, None, (f"no tier is called phones; {name} is taken for them by its labels",))
    if not spoken:
        points = [tier.name for tier in grid.tiers if tier.of_points and _PHONES.search(tier.name.lower())]
        names = ", ".join(tier.name for tier in grid.tiers) or "none"
        why = f"; {points[0]!r} is a tier of points, which have no length" if points else ""
        raise FacesynthError(f"{path} has no tier of intervals named 'phones'; its tiers are {names}{why}")
    whose, remarks = _chosen(spoken, path, speaker)
    spoken_words, confidences = _by_speaker(grid.tiers, _WORDS), _by_speaker(grid.tiers, _CONFIDENCES)
    alone = next(iter(spoken_words.values())) if len(spoken_words) == 1 and len(spoken) == 1 else None
    return SpeakerTiers(spoken[whose], spoken_words.get(whose, alone), confidences.get(whose), remarks)


def _without_empty(spoken: dict[str, Tier]) -> dict[str, Tier]:
    """Tiers of phones without that of no speaker, where nothing stands in it and speakers have theirs."""
    empty = "" in spoken and len(spoken) > 1 and not any(label.strip() for label, _, _ in spoken[""].intervals)
    return {name: tier for name, tier in spoken.items() if name or not empty}


def _by_labels(tiers: Sequence[Tier]) -> Tier | None:
    """The tier of the most intervals, where nearly all of its labels are phones and others than those of words."""
    full = [(sum(bool(label.strip()) for label, _, _ in tier.intervals), tier) for tier in tiers if not tier.of_points]
    most = max((count for count, _ in full), default=0)
    longest = [tier for count, tier in full if count == most]
    if len(longest) != 1 or _WORDS.search(longest[0].name.lower()):
        return None
    labels = {label.strip() for label, _, _ in longest[0].intervals} - {""}
    known = [label for label in labels if _is_phone(label, notation_of(labels))]
    return longest[0] if len(labels) > 2 and len(known) >= SHARE_OF_PHONES * len(labels) else None


def _is_phone(label: str, notation: Notation) -> bool:
    try:
        return bool(normalise_phone(label, notation))
    except FacesynthError:
        return False


def _by_speaker(tiers: Sequence[Tier], kind: re.Pattern[str]) -> dict[str, Tier]:
    """Tiers of intervals of a kind by their speaker's name; empty where the tier names none.

    The kind is a word of a tier's name, the last one that is any kind; only where no tier has such a word, a part of one.
    """
    found: dict[str, Tier] = {}
    spelt: dict[str, str] = {}
    intervals = [tier for tier in tiers if not tier.of_points]
    matches = {tier.name: _as_word(tier.name, kind) for tier in intervals}
    if not any(matches.values()):
        matches = {tier.name: kind.search(tier.name.lower()) for tier in intervals}
    for tier in intervals:
        match = matches[tier.name]
        if match is None:
            continue
        rest = f"{tier.name[: match.start()].rstrip(_BETWEEN)} {tier.name[match.end() :].lstrip(_BETWEEN)}"
        name = re.sub(r"^[(\[{]+|[)\]}]+$", "", _EMPTY_BRACKETS.sub("", rest).strip(_BETWEEN)).strip(_BETWEEN)
        name = spelt.setdefault(name.lower(), name)
        number = 2
        while name in found:
            name, number = f"{spelt[name.lower()]} {number}".strip() if number == 2 else f"{name[:-1]}{number}", number + 1
            spelt.setdefault(name.lower(), name)
        found[name] = tier
    return found


def _as_word(name: str, kind: re.Pattern[str]) -> re.Match[str] | None:
    """Where a kind is a word of a tier's name: not within the name of a Persephone, nor before the word of another kind."""
    words = [
        (match, pattern is kind)
        for pattern in (_PHONES, _WORDS, _CONFIDENCES)
        for match in pattern.finditer(name.lower())
        if _begins_word(name, match.start()) and _ends_word(name, match.end())
    ]
    last, is_kind = max(words, key=lambda word: word[0].start(), default=(None, False))
    return last if is_kind else None


def _begins_word(name: str, place: int) -> bool:
    return not place or not name[place - 1].isalpha() or (name[place - 1].islower() and name[place].isupper())


def _ends_word(name: str, place: int) -> bool:
    return place >= len(name) or not name[place].isalpha() or (name[place - 1].islower() and name[place].isupper())


def _chosen(spoken: dict[str, Tier], path: Path, speaker: str | None) -> tuple[str, tuple[str, ...]]:
    """Name of the speaker whose phones are taken, and what was left out."""
    named = [name for name in spoken if name]
    if speaker is not None and named:
        wanted = next((name for name in spoken if name.lower() == speaker.strip().lower()), None)
        if wanted is None:
            raise FacesynthError(f"{path}: {unknown('speaker', speaker, named)}")
        return wanted, ()
    speaking = [name for name, tier in spoken.items() if any(label.lower() not in QUIET for label, _, _ in tier.intervals)]
    if "" in spoken and spoken[""].name.lower() in ("phone", "phones") and not any(name.isdigit() for name in named):
        others = ", ".join(repr(spoken[name].name) for name in named)
        return "", ((f"the tier {spoken[''].name!r} is used, not {others}",) if others else ())
    if len(speaking) > 1:
        names = ", ".join(name or spoken[name].name for name in spoken)
        raise FacesynthError(f"{path} holds the phones of {len(spoken)} speakers ({names}); choose one with --speaker")
    whose = speaking[0] if speaking else next(iter(spoken))
    silent = ", ".join(name for name in named if name != whose)
    return whose, ((f"the phones are those of {whose or 'the tier without a name'}; {silent} says nothing",) if silent else ())


def following(segments: Sequence[Segment]) -> tuple[list[Segment], tuple[str, ...]]:
    """Segments that follow one another, as Praat shows them, and what was done to them.

    Those of no length go; where neighbours overlap a little, the boundary is set in the middle. What overlaps more stays.
    """
    empty = [segment for segment in segments if abs(segment[2] - segment[1]) <= NO_LENGTH_S]
    kept = [segment for segment in segments if abs(segment[2] - segment[1]) > NO_LENGTH_S]
    starts_s = [start_s for _, start_s, _ in kept]
    if starts_s != sorted(starts_s):
        kept.sort(key=lambda segment: segment[1])
    gone = sum(end_s <= 0 for _, _, end_s in kept)
    early_s = min((start_s for _, start_s, _ in kept), default=0.0)
    if early_s < -NO_LENGTH_S:
        kept = [(label, max(start_s, 0.0), end_s) for label, start_s, end_s in kept if end_s > 0]
    overlaps_s = []
    for number in range(1, len(kept)):
        (before, begin_s, stop_s), (label, start_s, end_s) = kept[number - 1 : number + 1]
        overlap_s = stop_s - start_s
        if 0 < overlap_s <= min(LARGEST_OVERLAP_S, (stop_s - begin_s) / 2, (end_s - start_s) / 2):
            middle_s = start_s + overlap_s / 2
            kept[number - 1 : number + 1] = [(before, begin_s, middle_s), (label, middle_s, end_s)]
            overlaps_s.append(overlap_s)
    told_s = [overlap_s for overlap_s in overlaps_s if overlap_s > TOLD_S]
    remarks = []
    if early_s < -NO_LENGTH_S:
        remarks.append(f"its times begin at {early_s:g} s; what lies before 0 ({gone} whole intervals) was left out")
    if starts_s != sorted(starts_s):
        remarks.append("its intervals are not in the order of their times; they were put into it")
    if empty:
        names = ", ".join(dict.fromkeys(label or "without a label" for label, _, _ in empty))
        remarks.append(f"{len(empty)} intervals of no length were left out ({names})")
    if told_s:
        remarks.append(f"{len(told_s)} intervals overlap, by up to {max(told_s):.1g} s; the boundary was set in the middle")
    return kept, tuple(remarks)
