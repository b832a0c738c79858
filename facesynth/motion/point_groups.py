"""Which points of a face are lips, jaw, brows, skull …: from what they are called, or from how they move."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from facesynth.inference.arrays import Floats

_CALLED: tuple[tuple[str, str], ...] = (
    ("eyelids", r"lid|eye(?!brow|br)"),
    ("brows", r"brow|^[lr]?bro|^[lr]bm$|^[lr]?eb[rl]?$"),
    ("upper_lip", r"(upper|up|top|sup|u)(mid|middle|inner|outer)?(lip|inner)|lip(s)?(upper|up|top|sup|u)|^ul[a-z]?$|^[lrcm]ul$"),
    (
        "lower_lip",
        r"(lower|low|bot|bottom|inf)(mid|middle|inner|outer)?(lip|inner)|lip(s)?(lower|low|bot|bottom|inf)|^lipl$|^ll$",
    ),
    ("mouth", r"corner|commiss|cheilion|mou|lip|^ml$|^mr$"),
    ("jaw", r"jaw|chin|mandib|gnath|pogon|menton|^ch$|^li$"),
    ("forehead", r"forehead|frhd|glabella|^[lr]?fh$"),
    ("nose", r"nose|nasi|nasal|nostr|nstr"),
    ("cheeks", r"cheek|chk|zyg|malar|^[lr]c$|puff"),
    ("tongue", r"tongue|^t[rbtdm]$"),
    ("head", r"head|^[a-z]{0,2}hd$|temple|^[lr]?ear|tragus|helmet|mastoid|crown|skull"),
)
"""Regions and how their points are usually called: letters of the name in lower case; the first that fits counts."""
_LIPS = ("upper_lip", "lower_lip")
_STILL = ("head", "forehead", "nose")
_NOT_STILL = re.compile(r"nostr|nstr|base|ala")
_SAYS_WHICH = re.compile(r"upper|lower|up|low|top|bottom|bot|sup|inf")
FEWEST_RIGID = 3
FEWEST_TO_SEE = 12
"""From so many points on, their movement is looked at."""
ROUNDS = 6
STILL_SHARE = 1 / 3
STILLEST_MM = 3.0
"""Points of the skull that wander farther are none."""
MOVES_MM = 0.7
"""Something in a face that speaks moves by more than this (root mean square)."""
MOUTH_MM = 35.0
LIPS_APART_MM = 45.0
LIP_MM = 11.0
"""Height of the lower lip."""
ABOVE_THE_MOUTH_MM = 10.0
LIKE_THE_BEST = 0.5
MOST_PAIRS = 3


@dataclass(frozen=True)
class Guess:
    """Point numbers by group, facing points of the lips, and how both were found."""

    groups: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    lip_pairs: tuple[tuple[int, int], ...] = ()
    said: str = ""


def guess_groups(names: Sequence[str], points: Floats | None = None) -> Guess:
    """Groups of markers by their names; where those say nothing, by the movement of points [T, K, 3] (mm, y up)."""
    by_name = _from_names(names, None if points is None else _middle(points))
    if len(by_name.groups) > 1 or points is None or len(names) < FEWEST_TO_SEE:
        return by_name
    return _from_movement(points)


def _middle(points: Floats) -> Floats | None:
    """[K, 3] where the points are most of the time; None where one is never seen."""
    seen = np.isfinite(points).all(axis=(1, 2))
    return np.median(points[seen], axis=0) if seen.any() else None


def _from_names(names: Sequence[str], shape: Floats | None) -> Guess:
    regions = [_region(name) for name in names]
    llip = [number for number, name in enumerate(names) if _letters(name) == "llip"]
    for number in llip:  # left, where there is a right one; lower otherwise
        regions[number] = "mouth" if any(_letters(name) == "rlip" for name in names) else "lower_lip"
    groups = {region: tuple(k for k, found in enumerate(regions) if found == region) for region, _ in _CALLED}
    groups = {region: members for region, members in groups.items() if members and region != "head"}
    mouth = tuple(k for k, region in enumerate(regions) if region in (*_LIPS, "mouth"))
    groups |= {"mouth": mouth} if mouth else {}
    rigid = _still(names, regions, shape)
    groups |= {"rigid": rigid} if rigid else {}
    return Guess(groups, _facing(names, groups, shape), "by their names") if groups else Guess()


def _letters(name: str) -> str:
    return "".join(letter for letter in name.rpartition(":")[2].lower() if letter.isalpha())


def _region(name: str) -> str:
    letters = _letters(name)
    return next((region for region, pattern in _CALLED if re.search(pattern, letters)), "")


def _still(names: Sequence[str], regions: Sequence[str], shape: Floats | None) -> tuple[int, ...]:
    """Points on the skull: those called after the head if they suffice, else forehead and nose with them."""
    for wanted in (_STILL[:1], _STILL):
        found = [k for k, name in enumerate(names) if regions[k] in wanted and not _NOT_STILL.search(_letters(name))]
        if len(found) >= FEWEST_RIGID and (shape is None or spans_a_plane(shape[found])):
            return tuple(found)
    return ()


def spans_a_plane(points: Floats) -> bool:
    """Whether points [N, 3] lie clearly off one line, so that a pose can be measured on them."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] > 0.05 * spread[0])


def _facing(names: Sequence[str], groups: Mapping[str, tuple[int, ...]], shape: Floats | None) -> tuple[tuple[int, int], ...]:
    """Upper and lower points whose names differ in that alone, the inner ones if there are any; else the nearest in width."""
    uppers, lowers = (groups.get(lip, ()) for lip in _LIPS)
    key = {k: _SAYS_WHICH.sub("", names[k].lower()) for k in (*uppers, *lowers)}
    pairs = [(a, b) for a in uppers for b in lowers if key[a] == key[b]]
    inner = [pair for pair in pairs if "inner" in names[pair[0]].lower()]
    if pairs:
        return tuple(inner or pairs)
    if len(uppers) == len(lowers) == 1:
        return ((uppers[0], lowers[0]),)
    if shape is None or not uppers or not lowers:
        return ()
    apart, a, b = min((abs(shape[a, 0] - shape[b, 0]), a, b) for a in uppers for b in lowers)
    return ((a, b),) if apart < LIPS_APART_MM / 4 else ()


def _from_movement(points: Floats) -> Guess:
    """What keeps its distances is skull; the two movers, one above the other, whose distance changes most are lips."""
    seen = points[np.isfinite(points).all(axis=(1, 2))]
    if len(seen) < 10:
        return Guess()
    rigid, moved = _skull(seen)
    wander = np.sqrt(np.square(moved - moved.mean(axis=0)).sum(axis=2).mean(axis=0))
    still = wander[list(rigid)]
    if not rigid or still.max() > STILLEST_MM or wander.max() < max(MOVES_MM, 2 * float(np.median(still))):
        return Guess()
    rest = np.median(moved, axis=0)
    pairs = _opening_pairs(moved, rest, wander, float(rest[list(rigid), 1].mean()))
    groups: dict[str, tuple[int, ...]] = {"rigid": rigid}
    if pairs:
        mouth = float(rest[[k for pair in pairs for k in pair], 1].mean())
        above = [k for k in rigid if rest[k, 1] > mouth + ABOVE_THE_MOUTH_MM]
        if len(above) >= FEWEST_RIGID and spans_a_plane(rest[above]):
            groups["rigid"] = tuple(above)
        groups |= _around_the_mouth(rest, wander, pairs, groups["rigid"])
    return Guess(groups, pairs, "by how they move")


def _skull(seen: Floats) -> tuple[tuple[int, ...], Floats]:
    """The points that move together most stiffly, and all points [T, K, 3] with the motion of those taken out."""
    from facesynth.motion.pose import remove_head

    count = max(FEWEST_RIGID + 1, round(STILL_SHARE * seen.shape[1]))
    kept = np.arange(seen.shape[1])
    rest = seen[len(seen) // 2]
    moved = seen
    for _ in range(ROUNDS):
        if not spans_a_plane(rest[kept]):
            return (), seen
        moved = remove_head(seen, rest, kept)[0].astype(np.float64)
        rest = np.median(moved, axis=0)
        wander = np.square(moved - rest).sum(axis=2).mean(axis=0)
        kept = np.sort(np.argsort(wander)[:count])
    return tuple(kept.tolist()), moved


def _opening_pairs(moved: Floats, rest: Floats, wander: Floats, below: float) -> tuple[tuple[int, int], ...]:
    """(upper, lower) points under the height `below` whose distance, against its mean, changes most."""
    places = np.flatnonzero(rest[:, 1] < below)
    scores: list[tuple[float, int, int]] = []
    for a in places.tolist():
        for b in places[wander[places] > wander.max() / 4].tolist():
            across, down = abs(rest[a, 0] - rest[b, 0]), rest[a, 1] - rest[b, 1]
            if 0 < down < LIPS_APART_MM and across < max(0.5 * down, 4.0):
                apart = np.linalg.norm(moved[:, a] - moved[:, b], axis=1)
                scores.append((float(apart.std() / (apart.mean() + 3.0)), a, b))
    scores.sort(reverse=True)
    pairs: list[tuple[int, int]] = []
    for score, a, b in scores:
        taken = {k for pair in pairs for k in pair}
        if score >= LIKE_THE_BEST * scores[0][0] and not {a, b} & taken and len(pairs) < MOST_PAIRS:
            pairs.append((a, b))
    return tuple(pairs)


def _around_the_mouth(
    rest: Floats, wander: Floats, pairs: tuple[tuple[int, int], ...], rigid: tuple[int, ...]
) -> dict[str, tuple[int, ...]]:
    upper, lower = (np.array(side) for side in zip(*pairs, strict=True))
    centre = (rest[upper].mean(axis=0) + rest[lower].mean(axis=0)) / 2
    off = rest - centre
    moves = (wander > wander.max() / 6) & ~np.isin(np.arange(len(rest)), rigid)
    near = moves & (np.abs(off[:, 0]) < MOUTH_MM) & (np.abs(off[:, 1]) < MOUTH_MM / 2)
    low = float(off[lower, 1].min()) - LIP_MM
    groups = {
        "upper_lip": near & (off[:, 1] >= float(off[upper, 1].min())),
        "lower_lip": near & (off[:, 1] <= float(off[lower, 1].max())) & (off[:, 1] > low),
        "mouth": near & (off[:, 1] > low),
        "jaw": moves & (off[:, 1] <= low),
    }
    return {name: tuple(np.flatnonzero(members).tolist()) for name, members in groups.items() if members.any()}
