"""Points of other systems that have a place among the head's own markers."""

from collections.abc import Mapping

_SIDES = {  # marker without its side: landmark on the performer's right, on the left
    "forehead_%s1": (109, 338), "forehead_%s2": (69, 299), "forehead_%s3": (103, 332),
    "brow_%s1": (107, 336), "brow_%s2": (66, 296), "brow_%s3": (105, 334), "brow_%s4": (63, 293), "brow_%s5": (65, 295),
    "brow_%s6": (53, 283),
    "upper_lid_%s1": (159, 386), "upper_lid_%s2": (160, 387), "lower_lid_%s1": (23, 253), "lower_lid_%s2": (110, 339),
    "nose_side_%s": (236, 456), "nostril_%s": (218, 438),
    "cheek_%s1": (120, 349), "cheek_%s2": (118, 347), "cheek_%s3": (111, 340), "cheek_%s4": (36, 266), "cheek_%s5": (50, 280),
    "cheek_%s6": (123, 352), "cheek_%s7": (206, 426), "cheek_%s8": (187, 411), "cheek_%s9": (147, 376),
    "cheek_%s10": (212, 432), "cheek_%s11": (138, 367),
    "upper_lip_%s1": (37, 267), "upper_lip_%s2": (40, 270), "mouth_corner_%s": (61, 291),
    "lower_lip_%s1": (84, 314), "lower_lip_%s2": (91, 321),
    "upper_inner_%s1": (82, 312), "upper_inner_%s2": (80, 310), "lower_inner_%s1": (87, 317),
    "jaw_%s1": (208, 428), "jaw_%s2": (176, 400), "jaw_%s3": (170, 395), "jaw_%s4": (136, 365), "jaw_%s5": (58, 288),
}  # fmt: skip
_MIDDLE = {
    "forehead_top": 10, "forehead_mid": 151, "nose_root": 168, "nose_bridge": 6, "nose_mid": 5, "nose_base": 2,
    "upper_lip": 0, "lower_lip": 17, "upper_inner": 13, "lower_inner": 14, "chin": 200, "chin_below": 175,
}  # fmt: skip

LANDMARKS: Mapping[str, str] = {
    **{f"p{number:03d}": marker for marker, number in _MIDDLE.items()},
    **{f"p{right:03d}": marker % "r" for marker, (right, _) in _SIDES.items()},
    **{f"p{left:03d}": marker % "l" for marker, (_, left) in _SIDES.items()},
}
"""Landmarks that video gives (`p000` to `p467`) to the marker of the head that they lie on.

The places were found by laying a real face, which 468 landmarks measured, on the head; all agree within 7 mm."""

KNOWN_POINTS: Mapping[str, str] = {
    # articulography: upper and lower lip, left corner, lower incisor
    "ul": "upper_lip", "ll": "lower_lip", "ml": "mouth_corner_l", "jaw": "chin", "li": "chin", "jawl": "jaw_l1",
    "upperlip": "upper_lip", "lowerlip": "lower_lip", "lipupper": "upper_lip", "liplower": "lower_lip",
    "ulip": "upper_lip", "llip": "lower_lip", "lipu": "upper_lip", "lipl": "lower_lip",
    "mouthr": "mouth_corner_r", "mouthl": "mouth_corner_l", "cornerr": "mouth_corner_r", "cornerl": "mouth_corner_l",
    "rmouth": "mouth_corner_r", "lmouth": "mouth_corner_l", "mouthright": "mouth_corner_r", "mouthleft": "mouth_corner_l",
    "chin": "chin", "browr": "brow_r2", "browl": "brow_l2", "cheekr": "cheek_r5", "cheekl": "cheek_l5",
    "eyelidr": "upper_lid_r1", "eyelidl": "upper_lid_l1", "foreheadr": "forehead_r2", "foreheadl": "forehead_l2",
    "forehead": "forehead_mid", "nose": "nose_mid", "nosetip": "nose_mid", "nosebridge": "nose_bridge",
}  # fmt: skip
"""Usual names, in lower case and without anything but letters and digits, to the head's markers."""
