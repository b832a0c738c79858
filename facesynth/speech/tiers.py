"""Which tiers of a TextGrid hold the phones and the words, and whose they are; intervals made to follow one another."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.speech.phone_labels import QUIET
from facesynth.speech.praat import Grid, Tier
from facesynth.speech.segments import Segment

_PHONES = re.compile(r"phone(?:me|mic|tic)?s?|(?<![a-z])ph(?:n|on)?s?(?![a-z])|(?<![a-z])phonalign|^mau(?![a-z])")
_WORDS = re.compile(r"words?|(?<![a-z])tokensalign|^ort(?:-mau)?(?![a-z])|(?<![a-z])orthograph(?:y|ic)")
"""As the Montreal aligner, ELAN, WebMAUS and SPPAS call them."""
_CONFIDENCES = re.compile(r"confidences?")
_BETWEEN = " -_@:./|#,;&"
"""Between the name of a speaker and that of a kind of tier."""

NO_LENGTH_S = 1e-6
LARGEST_OVERLAP_S = 0.01
"""Neighbours that overlap by more were not meant to touch."""
TOLD_S = 1e-9
"""Below this an overlap is the rounding of the last digit."""


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
    spoken = _by_speaker(grid.tiers, _PHONES)
    if not spoken:
        points = [tier.name for tier in grid.tiers if tier.of_points and _PHONES.search(tier.name.lower())]
        names = ", ".join(tier.name for tier in grid.tiers) or "none"
        why = f"; {points[0]!r} is a tier of points, which have no length" if points else ""
        raise FacesynthError(f"{path} has no tier of intervals named 'phones'; its tiers are {names}{why}")
    whose, remarks = _chosen(spoken, path, speaker)
    words, confidences = _by_speaker(grid.tiers, _WORDS), _by_speaker(grid.tiers, _CONFIDENCES)
    alone = next(iter(words.values())) if len(words) == 1 and len(spoken) == 1 else None
    return SpeakerTiers(spoken[whose], words.get(whose, alone), confidences.get(whose), remarks)


def _by_speaker(tiers: Sequence[Tier], kind: re.Pattern[str]) -> dict[str, Tier]:
    """Tiers of intervals of a kind by their speaker's name; empty where the tier names none."""
    found: dict[str, Tier] = {}
    spelt: dict[str, str] = {}
    for tier in tiers:
        match = kind.search(tier.name.lower())
        if match is None or tier.of_points:
            continue
        rest = f"{tier.name[: match.start()].rstrip(_BETWEEN)} {tier.name[match.end() :].lstrip(_BETWEEN)}"
        name = re.sub(r"^[(\[{]+|[)\]}]+$", "", rest.strip(_BETWEEN)).strip(_BETWEEN)
        name = spelt.setdefault(name.lower(), name)
        number = 2
        while name in found:
            name, number = f"{spelt[name.lower()]} {number}".strip() if number == 2 else f"{name[:-1]}{number}", number + 1
            spelt.setdefault(name.lower(), name)
        found[name] = tier
    return found


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
    if empty:
        names = ", ".join(dict.fromkeys(label or "without a label" for label, _, _ in empty))
        remarks.append(f"{len(empty)} intervals of no length were left out ({names})")
    if told_s:
        remarks.append(f"{len(told_s)} intervals overlap, by up to {max(told_s):.1g} s; the boundary was set in the middle")
    return kept, tuple(remarks)
