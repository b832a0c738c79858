"""Sheets of the built-in head for looking at: visemes, shapes made by hand from front and side, emotions, heads, blinks, gazes.

python benchmarks/face_sheet.py folder/
"""

import csv
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from facesynth.face.draw.render import Renderer
from facesynth.face.rig.arkit_rig import Rig, load_head, pose
from facesynth.face.rig.markers import LipGap
from facesynth.methods.coarticulation.by_hand import PHONES_COLUMN, SHIPPED
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.performer.emotion import POSES

MOUTH = (540, 380, 740, 560)
FACE = (400, 0, 880, 720)
CLOSED = -0.3  # mm: lips pressed together

VISEMES = {
    "rest": {},
    "P": {"jawOpen": 0.05, "mouthPress": 0.16, "mouthRollLower": 0.28, "mouthRollUpper": 0.2, "gap": CLOSED},
    "F": {"jawOpen": 0.045, "mouthRollLower": 0.62, "mouthUpperUp": 0.3, "mouthShrugUpper": 0.1, "gap": 2.4},
    "TH": {"jawOpen": 0.11, "mouthLowerDown": 0.26, "mouthUpperUp": 0.22, "tongueOut": 0.34, "tongue": 0.5},
    "S": {"jawOpen": 0.012, "mouthStretch": 0.24, "mouthSmile": 0.08, "mouthLowerDown": 0.5, "mouthUpperUp": 0.34},
    "SH": {"jawOpen": 0.025, "mouthPucker": 0.32, "mouthFunnel": 0.72, "mouthLowerDown": 0.28, "mouthUpperUp": 0.24},
    "L": {"jawOpen": 0.12, "mouthLowerDown": 0.26, "mouthUpperUp": 0.18, "tongue": 1.0},
    "W": {"jawOpen": 0.04, "mouthPucker": 1.0, "mouthFunnel": 0.22},
    "AA": {"jawOpen": 0.36, "mouthLowerDown": 0.22, "mouthUpperUp": 0.12, "mouthFunnel": 0.05},
    "AE": {"jawOpen": 0.3, "mouthStretch": 0.22, "mouthSmile": 0.1, "mouthLowerDown": 0.32, "mouthUpperUp": 0.28},
    "AO": {"jawOpen": 0.27, "mouthPucker": 0.22, "mouthFunnel": 0.48, "mouthLowerDown": 0.12, "mouthUpperUp": 0.05},
    "IY": {"jawOpen": 0.055, "mouthStretch": 0.38, "mouthSmile": 0.16, "mouthLowerDown": 0.4, "mouthUpperUp": 0.3},
    "UW": {"jawOpen": 0.055, "mouthPucker": 0.85, "mouthFunnel": 0.32},
    "wide": {"jawOpen": 0.8},
}
LOOKS = {
    "turned left": ({}, [0.05, 0.6, 0.0]),
    "turned right": ({"jawOpen": 0.2}, [0.0, -0.6, 0.05]),
    "nodding": ({"mouthSmile": 0.4}, [0.3, 0.1, 0.0]),
    "blink": ({"eyeBlink": 1.0}, [0, 0, 0]),
    "half blink": ({"eyeBlink": 0.5}, [0, 0, 0]),
    "looking left": ({"eyeLookOutLeft": 0.8, "eyeLookInRight": 0.8}, [0, 0, 0]),
    "looking up": ({"eyeLookUp": 0.8, "browOuterUp": 0.6, "browInnerUp": 0.6}, [-0.15, 0, 0]),
    "surprised": ({"jawOpen": 0.4, "eyeWide": 1.0, "browOuterUp": 1.0, "browInnerUp": 1.0}, [0, 0, 0]),
}


SIDE = [0.0, 1.3, 0.0]
PROFILE = (780, 330, 1040, 610)


def shapes_by_hand() -> dict[str, dict[str, float]]:
    """The table that comes with facesynth, by its phones."""
    with SHIPPED["arkit"].open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {row.pop(PHONES_COLUMN): {name: float(value) for name, value in row.items()} for row in rows}


def weights_of(rig: Rig, shapes: dict[str, float]) -> np.ndarray:
    """Weights from names; a name without a side means both sides, `gap` closes the lips to so many mm."""
    weights = np.zeros(52)
    for name, value in shapes.items():
        for full in (name, f"{name}Left", f"{name}Right"):
            if full in ARKIT_NAMES:
                weights[ARKIT_NAMES.index(full)] = value
    return LipGap.of(rig).closed(weights, shapes["gap"]) if "gap" in shapes else weights


def sheet(
    pictures: list[np.ndarray], labels: list[str], columns: int, crop: tuple[int, int, int, int], scale: float
) -> Image.Image:
    width, height = round((crop[2] - crop[0]) * scale), round((crop[3] - crop[1]) * scale)
    rows = -(-len(pictures) // columns)
    whole = Image.new("RGB", (columns * width, rows * height))
    for k, (picture, label) in enumerate(zip(pictures, labels, strict=True)):
        tile = Image.fromarray(picture).crop(crop).resize((width, height), Image.Resampling.LANCZOS)
        ImageDraw.Draw(tile).text((8, 6), label, fill=(255, 255, 255))
        whole.paste(tile, (k % columns * width, k // columns * height))
    return whole


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rig = load_head()
    renderer = Renderer.of(rig)

    def shot(shapes: dict[str, float], turn: list[float]) -> np.ndarray:
        return renderer.render(pose(rig, weights_of(rig, shapes), [*turn, 0, 0, 0], tongue_up=shapes.get("tongue", 0)))

    mouths = [shot(shapes, [0, 0, 0]) for shapes in VISEMES.values()]
    sheet(mouths, list(VISEMES), 7, MOUTH, 1.3).save(folder / "visemes.png")
    made = shapes_by_hand()
    for name, turn, crop in (("by_hand", [0.0, 0.0, 0.0], MOUTH), ("by_hand_side", SIDE, PROFILE)):
        sheet([shot(shapes, turn) for shapes in made.values()], list(made), 7, crop, 0.8).save(folder / f"{name}.png")
    faces = {f"{emotion} {sound}": POSES[emotion] | VISEMES[sound] for sound in ("rest", "AA") for emotion in POSES}
    sheet([shot(shapes, [0, 0, 0]) for shapes in faces.values()], list(faces), 4, FACE, 0.8).save(folder / "emotions.png")
    sheet([shot(*look) for look in LOOKS.values()], list(LOOKS), 4, FACE, 0.8).save(folder / "looks.png")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
