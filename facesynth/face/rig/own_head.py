"""A head of somebody's own: triangles with morph targets under its own names, read from glTF or from OBJ files."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from facesynth.face.animation import FaceAnimation
from facesynth.face.files.gltf.document import is_binary
from facesynth.face.files.gltf.scene import Part, Scene, read_scene
from facesynth.face.rig.channel_map import ChannelMap, arkit_name
from facesynth.face.rig.mapping_file import HeadMapping
from facesynth.face.rig.obj import read_shapes
from facesynth.face.rig.presets import asked_for, by_expressions, fitting
from facesynth.inference.errors import FacesynthError, unknown

TEXELS = 5
"""Points along a triangle's side at which its colours are kept."""
FACE_MM = 150.0
"""Height of what a face's shapes move, from the brows to the chin."""
LIKELY_FACE_MM = (70.0, 320.0)
LARGEST_MM = 1e7
"""No point of a head lies so far from its face."""
M_PER_UNIT_MM = 1000.0
MOVED_SHARE = 0.05
"""A vertex belongs to the face if a shape moves it by this share of the largest movement."""
USUAL_JAW_DEG = 20
"""A jaw that is open as far as it goes."""
_JAW = re.compile(r"jaw|mandib|chin|あご|顎|下巴|kiefer", re.IGNORECASE)
_EYE = re.compile(r"eye(?!.*(lash|brow|lid|socket|occl|wet|shadow|tear|blink|liner))", re.IGNORECASE)
SUFFIXES = (".glb", ".gltf", ".vrm")


@dataclass(frozen=True, eq=False)
class Joint:
    """A node of a head that a channel turns, with all that hangs on it."""

    channel: int
    node: int
    pivot_mm: NDArray[np.float64]
    """[3]"""
    turn: NDArray[np.float64]
    """[3] rotation vector at value 1, rad."""
    weight: NDArray[np.float32]
    """[V] share of its motion that a vertex follows."""


@dataclass(frozen=True, eq=False)
class OwnHead:
    """V vertices, F triangles and N channels; mm, x to the head's left, y up, z out of the face, origin amid the face."""

    source: Path
    rest_mm: NDArray[np.float32]
    """[V, 3]"""
    shapes_mm: NDArray[np.float32]
    """[N, V, 3] displacement at value 1."""
    map: ChannelMap
    """Names of the N channels, and how they follow ARKit's weights."""
    triangles: NDArray[np.int32]
    """[F, 3] counter-clockwise seen from outside."""
    colours: NDArray[np.float32]
    """[F, TEXELS, TEXELS, 3] linear albedo."""
    head_weight: NDArray[np.float32]
    """[V] share of the head's motion that a vertex follows."""
    pivot_mm: NDArray[np.float64]
    """[3] the point about which the head turns."""
    eyes: tuple[tuple[NDArray[np.int64], NDArray[np.float64]], ...]
    """Vertices and centre of each eyeball that must be turned because no channel does."""
    face_mm: NDArray[np.float64]
    """[2, 3] lowest and highest corner of what the shapes move."""
    mm_per_unit: float
    """Of the file's own unit."""
    middle: NDArray[np.float64]
    """[3] the origin in the file's own axes and unit."""
    head_node: int | None = None
    """The node of a glTF file that turns with the head."""
    eye_nodes: tuple[int, ...] = ()
    """The node of each of `eyes`."""
    joints: tuple[Joint, ...] = ()
    """What channels turn, in place of moving it by a shape."""
    remarks: tuple[str, ...] = ()
    """What was assumed of the head, for a person."""

    @property
    def names(self) -> tuple[str, ...]:
        """The N channels."""
        return self.map.names

    def vertices(self, animation: FaceAnimation, k: int) -> NDArray[np.float32]:
        """[V, 3] mm at frame k of an animation of this head's channels."""
        return self.posed(animation.weights[k], animation.head[k], animation.gaze[k])

    def posed(self, values: ArrayLike, head: ArrayLike | None = None, gaze: ArrayLike | None = None) -> NDArray[np.float32]:
        """Vertices [V, 3] under channel values [N], a head pose [6] (rad, mm about `pivot_mm`) and a gaze [2] (rad left, up)."""
        amounts = np.asarray(values, np.float32)
        active = np.flatnonzero(amounts)
        vertices = self.rest_mm + np.tensordot(amounts[active], self.shapes_mm[active], 1)
        for joint in self.joints:
            turn = Rotation.from_rotvec(joint.turn * float(amounts[joint.channel]))
            moved = turn.apply(vertices - joint.pivot_mm) + joint.pivot_mm
            vertices = vertices + joint.weight[:, None] * (moved - vertices)
        if gaze is not None:
            left, up = np.asarray(gaze, np.float64)
            turn = Rotation.from_euler("YX", [left, -up])
            for ball, centre in self.eyes:
                vertices[ball] = turn.apply(vertices[ball] - centre) + centre
        if head is not None:
            pose = np.asarray(head, np.float64)
            moved = Rotation.from_rotvec(pose[:3]).apply(vertices - self.pivot_mm) + self.pivot_mm + pose[3:]
            vertices = vertices + self.head_weight[:, None] * (moved - vertices)
        return vertices.astype(np.float32)


def load_own_head(path: str | Path, mapping: str | Path | None = None, *, needs_arkit: bool = True) -> OwnHead:
    """A head from a .glb or .gltf file, or from a folder of OBJ files: the neutral one and one for each shape.

    The mapping is that of the file or of the preset given, else `NAME.yaml` beside `NAME.glb`, else the channels' names are
    ARKit's, or those of the preset that fits them best.
    needs_arkit: whether some channel must follow ARKit's weights; not so where values come in the head's own channels.
    """
    path = Path(path)
    beside = path.with_suffix(".yaml")
    found = Path(mapping) if mapping is not None else beside if beside.is_file() else None
    if path.is_dir():
        return _from_obj(path, found, needs_arkit)
    if path.suffix.lower() not in SUFFIXES and not (path.is_file() and is_binary(path)):
        raise FacesynthError(f"{path} is no head: wanted .glb, .gltf, .vrm, or a folder of OBJ files")
    return _from_scene(path, read_scene(path, TEXELS), found, needs_arkit)


def _mapping(
    found: Path | None, names: Sequence[str], expressions: Mapping[str, Mapping[str, float]]
) -> tuple[HeadMapping, tuple[str, ...]]:
    """What is said of channels of these names, and by whom, where nobody asked for that."""
    if found is not None:
        return asked_for(found, names), ()
    name, channels = fitting(names)
    moved = sum(bool(channel.shares) for channel in channels.values())
    avatar, through = by_expressions(expressions)
    if len(through) > max(moved, sum(arkit_name(channel) is not None for channel in names)):
        told = f"{len(through)} of its {len(names)} channels follow the preset {avatar} through the avatar's expressions"
        return HeadMapping(through), (f"{told}; --mapping takes another, or a file of your own",)
    said = f"{moved} of its {len(names)} channels follow the preset {name}; --mapping takes another, or a file of your own"
    return HeadMapping(channels), (said,) if name else ()


def _from_scene(path: Path, scene: Scene, found: Path | None, needs_arkit: bool) -> OwnHead:
    names = tuple(dict.fromkeys(name for part in scene.parts for name in part.targets))
    told, assumed = _mapping(found, names, scene.expressions)
    turned = [name for name, channel in told.channels.items() if channel.turn_deg is not None]
    names += tuple(name for name in turned if name not in names)
    vertices = np.concatenate([part.vertices for part in scene.parts])
    starts = np.cumsum([0, *(len(part.vertices) for part in scene.parts)])
    shapes = np.zeros((len(names), len(vertices), 3), np.float32)
    for part, start in zip(scene.parts, starts[:-1], strict=True):
        for name, moved in part.targets.items():
            shapes[names.index(name), start : start + len(moved)] = moved
    channel_map = ChannelMap.of(names, told.channels, needs_arkit=needs_arkit)
    node = _head_node(scene, told)
    weight = np.ones(len(vertices))
    if node is not None:
        weight = np.concatenate([part.follows[:, scene.below(node)].sum(axis=1) for part in scene.parts])
    balls = [
        (np.arange(start, start + len(part.vertices)), int(part.follows.sum(axis=0).argmax()))
        for part, start in zip(scene.parts, starts[:-1], strict=True)
        if _is_eyeball(part, scene)
    ]
    triangles = np.concatenate([part.triangles + start for part, start in zip(scene.parts, starts[:-1], strict=True)])
    colours = np.concatenate([part.colours for part in scene.parts])
    pivot = None if node is None else scene.places[node, :3, 3]
    eye_nodes = tuple(number for _, number in balls)
    arrays = (vertices, shapes, triangles, colours, weight)
    placed = _placed(path, arrays, channel_map, told, M_PER_UNIT_MM, pivot, [ball for ball, _ in balls], node, eye_nodes)
    joints = tuple(_joint(placed, scene, name) for name in turned)
    return replace(placed, joints=joints, remarks=(*assumed, *scene.remarks, *_hanging(scene, joints)))


def _joint(head: OwnHead, scene: Scene, name: str) -> Joint:
    """The joint of a channel that turns the node of this name."""
    if name not in scene.names:
        raise unknown("node that a mapping turns", name, [known for known in scene.names if known])
    node, channel = scene.names.index(name), head.names.index(name)
    weight = np.concatenate([part.follows[:, scene.below(node)].sum(axis=1) for part in scene.parts])
    pivot_mm = (scene.places[node, :3, 3] - head.middle) * head.mm_per_unit
    turn = np.deg2rad(head.map.channels[channel].turn_deg or (0.0, 0.0, 0.0))
    return Joint(channel, node, pivot_mm, turn, np.clip(weight, 0, 1).astype(np.float32))


def _hanging(scene: Scene, joints: Sequence[Joint]) -> Iterator[str]:
    """A line where teeth or tongue have no shapes and hang on a jaw that nothing turns."""
    turned = {int(node) for joint in joints for node in scene.below(joint.node)}
    for jaw in (i for i, name in enumerate(scene.names) if _JAW.search(name) and i not in turned):
        below = scene.below(jaw)
        parts = [part for part in scene.parts if not part.targets and part.follows[:, below].sum(axis=1).mean() > 0.5]
        if parts:
            what = ", ".join(dict.fromkeys(scene.names[part.node] or part.name for part in parts))
            name = scene.names[jaw]
            yield (
                f"{what} hang on the joint {name}, which no channel turns: they stay shut while the mouth opens; in a mapping"
                f" `{name}: {{from: jawOpen, turn: [{USUAL_JAW_DEG}, 0, 0]}}` turns it"
            )
            return


def _from_obj(folder: Path, found: Path | None, needs_arkit: bool) -> OwnHead:
    names, neutral, moved, triangles = read_shapes(folder)
    told, assumed = _mapping(found, names, {})
    colours = np.full((len(triangles), TEXELS, TEXELS, 3), 0.45)
    arrays = (neutral, moved.astype(np.float32), triangles, colours, np.ones(len(neutral)))
    channel_map = ChannelMap.of(names, told.channels, needs_arkit=needs_arkit)
    return replace(_placed(folder, arrays, channel_map, told, None, None, [], None, ()), remarks=assumed)


def _placed(
    path: Path,
    arrays: tuple[NDArray, NDArray, NDArray, NDArray, NDArray],
    channel_map: ChannelMap,
    told: HeadMapping,
    usual_unit_mm: float | None,
    pivot: NDArray[np.float64] | None,
    balls: Sequence[NDArray[np.int64]],
    node: int | None,
    eye_nodes: tuple[int, ...],
) -> OwnHead:
    """In mm, with the middle of the face in the origin."""
    vertices, shapes, triangles, colours, weight = arrays
    low, high = _face_box(path, vertices, shapes, channel_map)
    unit_mm = told.mm_per_unit or _unit_mm(float(high[1] - low[1]), usual_unit_mm)
    middle = (low + high) / 2
    neck = np.array([middle[0], low[1], low[2]]) if pivot is None else pivot
    rest = (vertices - middle) * unit_mm
    if not np.abs(rest).max() < LARGEST_MM:
        raise FacesynthError(f"{path} has points more than {LARGEST_MM / 1e6:g} km from its face; move or delete them")
    return OwnHead(
        path,
        rest.astype(np.float32),
        shapes * np.float32(unit_mm),
        channel_map,
        triangles.astype(np.int32),
        colours.astype(np.float32),
        np.clip(weight, 0, 1).astype(np.float32),
        (neck - middle) * unit_mm,
        tuple((ball, (rest[ball].min(axis=0) + rest[ball].max(axis=0)) / 2) for ball in balls),
        np.stack([low - middle, high - middle]) * unit_mm,
        unit_mm,
        middle,
        node,
        eye_nodes,
    )


def _face_box(path: Path, vertices: NDArray, shapes: NDArray, channel_map: ChannelMap) -> tuple[NDArray, NDArray]:
    used = [i for i, channel in enumerate(channel_map.channels) if channel.shares] or slice(None)
    reach = np.linalg.norm(shapes[used], axis=2).max(axis=0, initial=0.0)
    moved = vertices[reach > MOVED_SHARE * reach.max()] if reach.max() > 0 else vertices[:0]
    if len(moved) < 3:
        raise FacesynthError(f"{path}: its shapes move nothing; export the head with its shape keys")
    return moved.min(axis=0), moved.max(axis=0)


def _unit_mm(face_height: float, usual_unit_mm: float | None) -> float:
    if usual_unit_mm is not None and LIKELY_FACE_MM[0] <= face_height * usual_unit_mm <= LIKELY_FACE_MM[1]:
        return usual_unit_mm
    return FACE_MM / max(face_height, 1e-9)


def _head_node(scene: Scene, told: HeadMapping) -> int | None:
    if told.head:
        if told.head not in scene.names:
            raise unknown("node of the head", told.head, [name for name in scene.names if name])
        return scene.names.index(told.head)
    jointed = {int(node) for part in scene.parts for node in np.flatnonzero(part.follows.any(axis=0))}
    if scene.head is not None:
        return scene.head
    called = [i for i, name in enumerate(scene.names) if re.search(r"(^|[:_.|])head$", name, re.IGNORECASE)]
    return next((node for node in called if jointed & set(scene.below(node).tolist())), None)


def _is_eyeball(part: Part, scene: Scene) -> bool:
    """Whether a part is an eyeball by name that no channel moves: then its node has to turn."""
    name = scene.names[part.node] or part.name
    return bool(_EYE.search(name)) and not part.targets
