"""Fill site/ for the page that listens: python make_live.py [site]. Then: npm install && npm run build."""

import json
import sys
from pathlib import Path

import numpy as np
from make_site import head

from facesynth.export.phones import export_phones
from facesynth.face.animation import FaceAnimation
from facesynth.face.rig.arkit_rig import load_head
from facesynth.face.rig.markers import INNER_LIPS
from facesynth.inference.phones import PHONES, SILENCE
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.zoo.shelf import load


def main(site: Path) -> None:
    rig = load_head()
    export_phones(site / "hearing", "float16")
    shapes, kinds = shapes_by_hand()
    still = np.zeros((len(shapes), 6))
    posed = FaceAnimation(ARKIT_NAMES, shapes, still, still[:, :2], still[:, 0], 1.0)
    moved = np.stack([rig.vertices(posed, k) - rig.rest_mm for k in range(len(shapes))])
    (site / "shapes.bin").write_bytes(moved.astype("<f4").tobytes())
    lips = rig.from_source(np.array(INNER_LIPS)).tolist()
    said = {"kinds": kinds, "silence": SILENCE, "lips": lips}
    (site / "head.json").write_text(json.dumps(head(rig) | said))


def shapes_by_hand() -> tuple[np.ndarray, dict[str, int]]:
    """The different shapes [K, 52] of the model that comes with facesynth, and which one each phone has."""
    parts = load("arkit-shapes").model.parts
    of_phones = parts.decode(parts.keys.phones.astype(np.float32))
    own = [parts.layout.names.index(name) if name in parts.layout.names else -1 for name in ARKIT_NAMES]
    weights = np.where(np.array(own) >= 0, of_phones[:, own], 0.0).clip(0, 1)
    shapes, kinds = np.unique(weights, axis=0, return_inverse=True)
    return shapes, dict(zip(PHONES, kinds.ravel().tolist(), strict=True))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "site")
