"""Fill site/ for the page: python make_site.py lds.safetensors speech.wav [site]. Then: npm install && npm run build."""

import json
import sys
from pathlib import Path

import numpy as np

from facesynth.export.folder import Content, Subject, write_folder
from facesynth.export.models import export_model
from facesynth.export.parts import mesh_deformation_graph
from facesynth.face.rig.anny import PARTS
from facesynth.face.rig.arkit_rig import Rig, load_head
from facesynth.face.rig.markers import marker_layout
from facesynth.inference.errors import FacesynthError
from facesynth.speech.audio import load_audio, resample, save_wav

RATE = 16000
TINTS = {"skin": (0.86, 0.66, 0.56), "tongue": (0.72, 0.33, 0.33)}
WHITE, DARK, BROWN = (0.93, 0.92, 0.9), (0.15, 0.12, 0.1), (0.42, 0.27, 0.16)
IRIS_MM = 6.0


def main(model: Path, speech: Path, site: Path) -> None:
    rig = load_head()
    layout = marker_layout(rig)
    manifest = export_model(model, site / "model", only="lds")
    if "features" not in manifest["graphs"]:
        raise FacesynthError(f"{model} hears with the phone network, the page does not; train one with hears=periodogram")
    subject = Subject("graphs", {"licences": ["CC0-1.0"], "consents": ["nobody was recorded"]}, layout.to_dict(), None, ())
    write_folder(site / "face", subject, Content((mesh_deformation_graph(rig, layout),), {}, {"look_ahead_s": 0.0}))
    audio, rate = load_audio(speech)
    save_wav(site / "speech.wav", resample(audio, rate, RATE), RATE)
    (site / "head.json").write_text(json.dumps(head(rig)))


def head(rig: Rig) -> dict[str, list[float]]:
    """Rest pose [V, 3] mm, triangles and a colour for each vertex, flat."""
    quads = rig.quads
    triangles = np.concatenate([quads[:, :3], quads[quads[:, 2] != quads[:, 3]][:, [0, 2, 3]]])
    tints = np.array([TINTS.get(PARTS[part], DARK if "lashes" in PARTS[part] else WHITE) for part in rig.part])
    for side in ("left", "right"):
        ball = rig.vertices_of(f"{side}_eye")
        off_axis_mm = np.linalg.norm((rig.rest_mm[ball] - rig.eye_centre_mm(side))[:, :2], axis=1)
        tints[ball[off_axis_mm < IRIS_MM]] = BROWN
        tints[ball[off_axis_mm < IRIS_MM / 2]] = DARK
    arrays = {"rest": rig.rest_mm.round(3), "triangles": triangles, "tints": tints}
    return {name: array.ravel().tolist() for name, array in arrays.items()}


if __name__ == "__main__":
    here = Path(__file__).parent
    main(Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]) if len(sys.argv) > 3 else here / "site")
