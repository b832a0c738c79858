"""`speak --rig … --mapping …`: a head, or curves, under names that are not ARKit's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

if TYPE_CHECKING:
    from facesynth.face.rig.own_head import OwnHead
    from facesynth.inference.motion import Motion
    from facesynth.methods.method import Method

Change = Callable[["Motion"], "Motion"]


def own_rig_options(command: Any) -> Any:
    """The options --rig and --mapping."""
    file = click.Path(path_type=Path)
    helps = (
        ("--rig", "Head that is shown: .glb or .gltf with morph targets, or a folder of OBJ files; the built-in one otherwise."),
        (
            "--mapping",
            "YAML: which of the head's (or the model's) own channels follow which ARKit weights; NAME.yaml beside the head.",
        ),
    )
    for name, text in reversed(helps):
        command = click.option(name, type=file, help=text)(command)
    return command


def own_head(options: dict[str, Any]) -> OwnHead | None:
    """The head that was asked for."""
    if options["rig"] is None:
        return None
    from facesynth.face.rig.own_head import load_own_head

    return load_own_head(options["rig"], options["mapping"])


def as_arkit(method: Method, own: OwnHead | None, options: dict[str, Any], change: Change | None) -> Change | None:
    """What turns a motion of curves under own names into ARKit's, where a mapping says how; after `change`."""
    layout = method.fitted_layout
    from facesynth.face.rig.arkit import arkit_columns

    is_own = layout is not None and layout.kind == "curves" and not arkit_columns(layout)
    if options["mapping"] is None or not is_own or (own is not None and set(own.names) <= set(layout.names)):
        return change
    from facesynth.face.rig.arkit import ARKIT_NAMES
    from facesynth.face.rig.channel_map import ChannelMap
    from facesynth.face.rig.mapping_file import read_mapping
    from facesynth.inference.layout import Layout

    given = read_mapping(options["mapping"]).channels
    channel_map = ChannelMap.of(layout.names, {name: channel for name, channel in given.items() if name in layout.names})
    arkit = Layout("curves", ARKIT_NAMES)

    def mapped(motion: Motion) -> Motion:
        motion = change(motion) if change else motion
        return replace(motion, frames=channel_map.arkit(motion.frames).astype(np.float32), layout=arkit)

    return mapped
