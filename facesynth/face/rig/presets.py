"""Mappings for heads of usual makers, as files beside this module: by name, or the one that fits a head best."""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path

from facesynth.face.rig.channel_map import Channel, arkit_name, folded_names
from facesynth.face.rig.mapping_file import HeadMapping, read_mapping
from facesynth.inference.errors import unknown

PRESETS = (
    *("cc4", "facs", "metahuman", "unified", "meta", "sranipal", "daz", "vrm1", "vrm0", "readyplayerme", "oculus", "mmd"),
    *("mixamo", "cc3", "preston_blair", "rhubarb"),
)
"""Where two fit as well, the first is taken."""
ENOUGH = 15
"""A head with so many of ARKit's names is driven by those; visemes that it has beside them would move the mouth twice."""
_VISEME = re.compile(r"(?:^|[_:|./ -])V_[A-Z]|eCTRLv[A-Z]|(?:^|[:|./])(?:Open|Explosive|Dental_Lip|Tight.O|Affricate)$")
"""Visemes of Character Creator 4, of DAZ Studio and of Character Creator 3."""
_LEFT_UNIT = re.compile(r"AU\d{1,2}_[lL]$")
"""Beside it `AU12_r` is the right side, and not OpenFace's intensity of both."""
JAW = "jawOpen"
FEWEST = 3
"""Channels that a preset must drive, or half of them all, to be chosen by itself."""
FEWEST_ALONE, LETTERS = 2, 3
"""The same of a head without any of ARKit's names, which nothing else would move; names so short may mean anything there."""


def is_preset(mapping: str | Path) -> bool:
    """Whether a mapping is the name of a preset, and no file."""
    return str(mapping) in PRESETS and not Path(mapping).is_file()


def preset(name: str, channels: Sequence[str]) -> HeadMapping:
    """What a preset says of a head with these channels."""
    return HeadMapping(_matched(name, channels))


def asked_for(mapping: str | Path, channels: Sequence[str]) -> HeadMapping:
    """What a preset or a mapping file says of a head with these channels; FacesynthError where it is neither."""
    if is_preset(mapping):
        return preset(str(mapping), channels)
    if not Path(mapping).suffix and not Path(mapping).exists():
        raise unknown("mapping", str(mapping), PRESETS)
    return read_mapping(mapping)


def fitting(channels: Sequence[str]) -> tuple[str, Mapping[str, Channel]]:
    """The preset that drives most of these channels, and how; an empty name where ARKit's names do as well.

    One that opens the mouth goes before one that does not. A head with `ENOUGH` of ARKit's names takes from it only channels
    that follow weights which no name of ARKit's takes there, such as LipsFunnel beside jawOpen.
    """
    by_name = {channel: arkit for channel in channels if (arkit := arkit_name(channel))}
    ways = {name: _matched(name, channels) for name in PRESETS}
    if len(set(by_name.values())) >= ENOUGH:
        ways = {name: _beside(taken, by_name) for name, taken in ways.items()}
    best = max(PRESETS, key=lambda name: (_opens(ways[name], by_name), len(_moved(ways[name]) | set(by_name))))
    added = len(_moved(ways[best]) - set(by_name))
    alone = not by_name and sum(len(channel) > LETTERS for channel in _moved(ways[best])) >= FEWEST_ALONE
    fits = alone or added >= FEWEST or 2 * added >= len(channels) > 0
    return (best, ways[best]) if fits else ("", {})


def by_expressions(expressions: Mapping[str, Mapping[str, float]]) -> tuple[str, Mapping[str, Channel]]:
    """The preset of VRM that drives most of an avatar's channels by the expressions that they make up, and how; an empty name
    where it has none. expressions: the share of each channel in each.
    """
    ways = {name: _through(_matched(name, tuple(expressions)), expressions) for name in ("vrm1", "vrm0")}
    best = max(ways, key=lambda name: len(ways[name]))
    return (best, ways[best]) if ways[best] else ("", {})


def _through(ways: Mapping[str, Channel], expressions: Mapping[str, Mapping[str, float]]) -> dict[str, Channel]:
    """How channels follow weights by the expressions that they are part of."""
    shares: dict[str, dict[str, float]] = {}
    most: dict[str, float] = {}
    for expression, way in ways.items():
        for channel, part in expressions[expression].items():
            taken = shares.setdefault(channel, {})
            most[channel] = min(most.get(channel, 0.0) + part, 1.0)
            for weight, share in way.shares.items():
                taken[weight] = taken.get(weight, 0.0) + part * share
    return {channel: Channel(taken, high=most[channel]) for channel, taken in shares.items() if taken}


def _moved(ways: Mapping[str, Channel]) -> set[str]:
    return {channel for channel, way in ways.items() if way.shares}


def _opens(ways: Mapping[str, Channel], by_name: Mapping[str, str]) -> bool:
    """Whether a preset lowers the jaw of a head, or a name of ARKit's does, and the preset does more than that."""
    lowers = JAW in by_name.values() or any(JAW in way.shares for way in ways.values())
    return lowers and len(_moved(ways) - set(by_name)) >= FEWEST


def _beside(ways: Mapping[str, Channel], by_name: Mapping[str, str]) -> dict[str, Channel]:
    """Those channels that have no name of ARKit's and follow none of the weights that such names take."""
    taken = set(by_name.values())
    return {one: way for one, way in ways.items() if one not in by_name and way.shares and not taken & set(way.shares)}


def _matched(name: str, channels: Sequence[str]) -> dict[str, Channel]:
    ways, sided = _ways(name), any(_LEFT_UNIT.search(channel) for channel in channels)
    found = {
        channel: next((ways[plain] for plain in folded_names(channel.upper() if sided else channel) if plain in ways), None)
        for channel in channels
    }
    return _visemes_alone({channel: way for channel, way in found.items() if way is not None}, channels)


def _visemes_alone(ways: Mapping[str, Channel], channels: Sequence[str]) -> dict[str, Channel]:
    """Without those visemes `V_…` whose weights move other channels of the head: they would move the mouth twice."""
    visemes = {channel for channel in ways if _VISEME.search(channel)}
    taken = {arkit for channel in channels if channel not in visemes and (arkit := arkit_name(channel))}
    taken.update(weight for channel, way in ways.items() if channel not in visemes for weight in way.shares)
    return {
        channel: way
        for channel, way in ways.items()
        if channel not in visemes or not taken & {weight for weight, share in way.shares.items() if share > 0}
    }


@cache
def _ways(name: str) -> Mapping[str, Channel]:
    """How channels follow ARKit's weights, by their names as `folded_names` gives them."""
    with resources.as_file(resources.files(__package__).joinpath("presets", f"{name}.yaml")) as path:
        given = read_mapping(path).channels
    return {next(iter(folded_names(channel))): way for channel, way in given.items()}
