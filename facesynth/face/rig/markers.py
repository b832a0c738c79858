"""Where 90 markers sit on the built-in head, what they are called, and how far its lips are apart."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.face.rig.arkit_rig import Rig
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.lips import heights_between
from facesynth.motion.arkit_names import ARKIT_NAMES

HEAD_MARKERS: Mapping[str, tuple[tuple[str, int], ...]] = {
    "forehead": (
        ("forehead_top", 5192), ("forehead_mid", 5320), ("forehead_r1", 5194), ("forehead_l1", 11805),
        ("forehead_r2", 5318), ("forehead_l2", 11923), ("forehead_r3", 5197), ("forehead_l3", 11808),
    ),
    "brows": (
        ("brow_r1", 208), ("brow_l1", 6983), ("brow_r2", 223), ("brow_l2", 6997), ("brow_r3", 222), ("brow_l3", 6996),
        ("brow_r4", 224), ("brow_l4", 6998), ("brow_r5", 180), ("brow_l5", 6956), ("brow_r6", 206), ("brow_l6", 6981),
    ),
    "eyelids": (
        ("upper_lid_r1", 4897), ("upper_lid_l1", 11515), ("upper_lid_r2", 8), ("upper_lid_l2", 6792),
        ("lower_lid_r1", 42), ("lower_lid_l1", 6826), ("lower_lid_r2", 4859), ("lower_lid_l2", 11477),
    ),
    "nose": (
        ("nose_root", 169), ("nose_bridge", 135), ("nose_mid", 201), ("nose_base", 312),
        ("nose_side_r", 5257), ("nose_side_l", 11865), ("nostril_r", 338), ("nostril_l", 7100),
    ),
    "cheeks": (
        ("cheek_r1", 5061), ("cheek_l1", 11678), ("cheek_r2", 908), ("cheek_l2", 7610), ("cheek_r3", 218), ("cheek_l3", 6993),
        ("cheek_r4", 5147), ("cheek_l4", 11761), ("cheek_r5", 5065), ("cheek_l5", 11681), ("cheek_r6", 5325), ("cheek_l6", 11929),
        ("cheek_r7", 5322), ("cheek_l7", 11926), ("cheek_r8", 5302), ("cheek_l8", 11907), ("cheek_r9", 5154), ("cheek_l9", 11768),
        ("cheek_r10", 5218), ("cheek_l10", 11828), ("cheek_r11", 5299), ("cheek_l11", 11904),
    ),
    "lips_outer": (
        ("upper_lip", 455), ("lower_lip", 492), ("upper_lip_r1", 456), ("upper_lip_l1", 7215),
        ("upper_lip_r2", 411), ("upper_lip_l2", 7171), ("mouth_corner_r", 361), ("mouth_corner_l", 7122),
        ("lower_lip_r1", 486), ("lower_lip_l1", 7241), ("lower_lip_r2", 370), ("lower_lip_l2", 7130),
    ),
    "lips_inner": (
        ("upper_inner_r2", 417), ("upper_inner_r1", 515), ("upper_inner", 520), ("upper_inner_l1", 7262),
        ("upper_inner_l2", 7177), ("lower_inner_r1", 535), ("lower_inner", 540), ("lower_inner_l1", 7280),
    ),
    "jaw": (
        ("chin", 733), ("chin_below", 5211), ("jaw_r1", 5158), ("jaw_l1", 11772), ("jaw_r2", 5166), ("jaw_l2", 11779),
        ("jaw_r3", 5172), ("jaw_l3", 11784), ("jaw_r4", 5298), ("jaw_l4", 11903), ("jaw_r5", 5241), ("jaw_l5", 11850),
    ),
}  # fmt: skip
"""90 markers by region: name and vertex number in the head's source mesh; _r and _l are the performer's sides."""

LIP_PAIRS: tuple[tuple[str, str], ...] = (
    ("upper_inner_r1", "lower_inner_r1"), ("upper_inner", "lower_inner"), ("upper_inner_l1", "lower_inner_l1"),
)  # fmt: skip
"""Markers on the inner lips that face each other."""

RIGID = ("forehead_top", "forehead_r1", "forehead_l1", "nose_bridge", "nose_mid", "nose_side_r", "nose_side_l")
"""Markers that no shape moves by more than 1.2 mm at weight 1: they carry the motion of the head."""

INNER_LIPS: tuple[tuple[int, int], ...] = (
    (441, 405), (417, 536), (515, 535), (520, 540), (7262, 7280), (7177, 7281), (7201, 7165),
)  # fmt: skip
"""Seven facing pairs (upper, lower) of the inner lips from the performer's right to left, as source vertices."""

MIDDLE_LIPS = slice(2, 5)
"""Of those, the three pairs in the middle; beyond 10 mm from it they do not face each other closely enough."""


def marker_layout(rig: Rig) -> Layout:
    """The 90 markers as a layout of 270 channels whose neutral pose is the head at rest."""
    names = tuple(name for region in HEAD_MARKERS.values() for name, _ in region)
    pairs = tuple((names.index(upper), names.index(lower)) for upper, lower in LIP_PAIRS)
    neutral = rig.rest_mm[rig.from_source([vertex for region in HEAD_MARKERS.values() for _, vertex in region])]
    return Layout("markers", names, _groups(names), pairs, tuple(map(float, neutral.ravel())))


def marker_vertices(rig: Rig, layout: Layout) -> NDArray[np.int64]:
    """[K] vertex of the rig under each marker of a layout made of `HEAD_MARKERS`."""
    source = {name: vertex for region in HEAD_MARKERS.values() for name, vertex in region}
    strangers = [name for name in layout.names if name not in source]
    if strangers:
        raise FacesynthError(
            f"markers {strangers[:5]} have no known place on the built-in head; place them by nearest points instead"
        )
    return rig.from_source([source[name] for name in layout.names])


def _groups(names: tuple[str, ...]) -> dict[str, tuple[int, ...]]:
    regions = {region: [name for name, _ in members] for region, members in HEAD_MARKERS.items()}
    lips = regions["lips_outer"] + regions["lips_inner"]
    members = regions | {
        "mouth": lips,
        "upper_lip": [name for name in lips if name.startswith("upper")],
        "lower_lip": [name for name in lips if name.startswith("lower")],
        "rigid": list(RIGID),
        "upper_face": regions["forehead"] + regions["brows"] + regions["eyelids"],
    }
    return {group: tuple(names.index(name) for name in chosen) for group, chosen in members.items()}


@dataclass(frozen=True, eq=False)
class LipGap:
    """Vertical distance of the inner lips at seven places; linear in the weights, because blendshapes are."""

    rest_mm: NDArray[np.float64]
    """[7] gaps at rest, from the performer's right to left."""
    slopes_mm: NDArray[np.float64]
    """[7, 52] gap per unit of weight."""

    @classmethod
    def of(cls, rig: Rig) -> "LipGap":
        """Read the gaps off a rig."""
        pairs = rig.from_source(np.array(INNER_LIPS))
        rest_mm, slopes_mm = heights_between(rig.rest_mm, pairs), heights_between(rig.shapes_mm, pairs).T
        return cls(rest_mm.astype(np.float64), slopes_mm.astype(np.float64))

    def gaps_mm(self, weights: ArrayLike) -> NDArray[np.float64]:
        """[T, 7] gaps under weights [T, 52]; negative where the lips would pass through each other."""
        return np.asarray(weights, np.float64) @ self.slopes_mm.T + self.rest_mm

    def opening_mm(self, weights: ArrayLike) -> NDArray[np.float64]:
        """[T] mean gap of the three pairs in the middle."""
        return self.gaps_mm(weights)[..., MIDDLE_LIPS].mean(axis=-1)

    def closed(self, weights: ArrayLike, target_mm: ArrayLike, amount: ArrayLike = 1.0) -> NDArray[np.float64]:
        """Weights [T, 52] with as much mouthClose added as brings the opening down to `target_mm`.

        mouthClose undoes jawOpen at the lips only, so the jaw may stay open behind them. `amount` [T]
        in 0..1 goes part of the way. A mouth that is already narrower than the target is left alone.
        """
        column = ARKIT_NAMES.index("mouthClose")
        values = np.array(weights, np.float64)
        excess_mm = np.maximum(self.opening_mm(values) - np.asarray(target_mm), 0) * np.asarray(amount)
        values[..., column] += excess_mm / -self.slopes_mm[MIDDLE_LIPS, column].mean()
        return values
