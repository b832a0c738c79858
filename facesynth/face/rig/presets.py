"""Mappings for heads of usual makers, as files beside this module: by name, or the one that fits a head best."""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path

from facesynth.face.rig.channel_map import Channel, arkit_name, folded_names
from facesynth.face.rig.mapping_file import HeadMapping, read_mapping

PRESETS = ("cc4", "facs", "metahuman", "vrm1", "vrm0", "readyplayerme", "oculus", "mmd")
"""Where two fit as well, the first is taken."""
ENOUGH = 15
"""A head with so many of ARKit's names is driven by those; visemes that it has beside them would move the mouth twice."""
FEWEST = 3
"""Channels that a preset must drive, or half of them all, to be chosen by itself."""


def is_preset(mapping: str | Path) -> bool:
    """Whether a mapping is the name of a preset, and no file."""
    return str(mapping) in PRESETS and not Path(mapping).is_file()


def preset(name: str, channels: Sequence[str]) -> HeadMapping:
    """What a preset says of a head with these channels."""
    return HeadMapping(_matched(name, channels))


def fitting(channels: Sequence[str]) -> tuple[str, Mapping[str, Channel]]:
    """The preset that drives most of these channels, and how; an empty name where ARKit's names do as well."""
    by_name = {channel for channel in channels if arkit_name(channel)}
    if len({arkit_name(channel) for channel in by_name}) >= ENOUGH:
        return "", {}
    moved = {name: by_name | {one for one, way in _matched(name, channels).items() if way.shares} for name in PRESETS}
    best = max(PRESETS, key=lambda name: len(moved[name]))
    added = len(moved[best] - by_name)
    fits = added >= FEWEST or 2 * added >= len(channels) > 0
    return (best, _matched(best, channels)) if fits else ("", {})


def _matched(name: str, channels: Sequence[str]) -> dict[str, Channel]:
    ways = _ways(name)
    found = {channel: next((ways[plain] for plain in folded_names(channel) if plain in ways), None) for channel in channels}
    return {channel: way for channel, way in found.items() if way is not None}


@cache
def _ways(name: str) -> Mapping[str, Channel]:
    """How channels follow ARKit's weights, by their names as `folded_names` gives them."""
    with resources.as_file(resources.files(__package__).joinpath("presets", f"{name}.yaml")) as path:
        given = read_mapping(path).channels
    return {next(iter(folded_names(channel))): way for channel, way in given.items()}
