"""Lips and chin beside followed points: their layout, where no corners are looked for, and that they are found in real video."""

import json

import numpy as np
from click.testing import CliRunner

from facesynth.capture.landmarks import LIP_PAIRS
from facesynth.capture.points.mouth import LANDMARKS, mouth_mask
from facesynth.cli.corpus import corpus_group
from facesynth.corpus import Corpus
from facesynth.corpus.importers.points import kept_videos, shapes_beside
from facesynth.face.texture.compose import TexturedFace
from facesynth.inference.lips import lip_gap
from facesynth.motion.planar import has_mouth, inner_outline, is_tracked, tracked_layout
from facesynth.stage.speaker_pictures import speaker_of


def test_the_layout_names_what_the_mesh_finds():
    layout = tracked_layout(7, mouth=True)
    assert len(layout.names) == 7 + len(LANDMARKS)
    assert is_tracked(layout)
    assert has_mouth(layout)
    facing = {tuple(LANDMARKS[point - 7] for point in pair) for pair in layout.lip_pairs}
    assert facing == set(LIP_PAIRS)
    outline = [LANDMARKS[point - 7] for point in inner_outline(layout)]
    assert (outline[0], outline[10], outline[11], outline[-1]) == (78, 308, 324, 95)


def test_a_layout_without_a_mouth_stays_as_it_was():
    layout = tracked_layout(7)
    assert is_tracked(layout)
    assert not has_mouth(layout)
    assert not layout.lip_pairs
    assert len(inner_outline(layout)) == 0


def test_no_corners_on_the_lips():
    angles = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    mouth = np.column_stack([60 + 20 * np.cos(angles), 50 + 8 * np.sin(angles)])
    mask = mouth_mask(mouth, 100, 120)
    assert mask[mouth[:, 1].round().astype(int), mouth[:, 0].round().astype(int)].all()
    assert mask[60, 60]
    assert not mask[36, 60]
    assert not mask[80, 60]


def test_lips_are_found_in_real_video(recordings, landmark_models, tmp_path):
    """They open and shut, lie on the pictures where the mesh saw them, and hardly a recorded shape folds the mesh."""
    clip = sorted(recordings("grid_s26").glob("*.mpg"))[-1]
    (tmp_path / "a.lab").write_text("2.9 aa\n")
    result = CliRunner().invoke(
        corpus_group, ["add", str(tmp_path / "actor"), str(clip), "--phones", str(tmp_path / "a.lab"), "--points", "--json"]
    )
    assert result.exit_code == 0, result.output
    (added,) = json.loads(result.stdout)["added"]
    corpus = Corpus.open(tmp_path / "actor")
    motion = corpus[added].motion
    assert has_mouth(corpus.layout)
    gap = lip_gap(motion)
    assert gap.min() < 4
    assert gap.max() > 12
    shapes = shapes_beside(kept_videos(corpus)[added])
    assert shapes.points.shape[1] == len(corpus.layout.names)
    speaker = speaker_of(corpus)
    assert speaker.knows_lips
    face = TexturedFace(speaker)
    assert (face.mesh.narrow(face.mesh.vertices(speaker.shapes)).any(axis=1)).mean() <= 0.03
