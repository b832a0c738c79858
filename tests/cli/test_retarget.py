"""A performer's motion on a head of unknown shapes, from a table of key poses."""

import csv

import numpy as np
import pytest
from click.testing import CliRunner
from corpora import tiny_corpus
from own_heads import SHAPES, write_mask

from facesynth.cli import cli
from facesynth.inference.errors import FacesynthError
from facesynth.stage.key_poses import learned, read_key_poses


@pytest.fixture(scope="module")
def actor(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("actor") / "corpus")


def run(*arguments):
    return CliRunner().invoke(cli, ["retarget", *map(str, arguments)])


def filled(path, corpus, low=0.0):
    """The table with two channels that say how far the chin has fallen."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    chin = corpus.layout.names.index("chin")
    for row in rows:
        motion = corpus[row["utterance"]].motion
        fallen = (corpus.layout.neutral[3 * chin + 1] - motion.points[round(float(row["time_s"]) * motion.fps), chin, 1]) / 20
        row |= {"Mouth_Open": f"{np.clip(fallen, 0, 1):.3f}", "Smile_L": f"{low:.1f}"}
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, ["utterance", "time_s", "Mouth_Open", "Smile_L"], extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)


def test_from_frames_worth_posing_to_a_head_that_moves(actor, tmp_path):
    head, table = write_mask(tmp_path / "head.glb"), tmp_path / "poses.csv"
    assert run(actor.path, table, "--suggest", 12, "--rig", head).exit_code == 0
    assert table.read_text(encoding="utf-8").startswith("utterance,time_s," + ",".join(SHAPES))
    filled(table, actor)
    name = actor.ids[0]
    result = run(actor.path, table, name, "--rig", head, "-o", tmp_path / "{name}.csv", "-o", tmp_path / "{name}.glb", "--json")
    assert result.exit_code == 0, result.output
    curves = np.genfromtxt(tmp_path / f"{name}.csv", delimiter=",", names=True)
    assert curves.dtype.names == ("time_s", *SHAPES)
    motion, chin = actor[name].motion, actor.layout.names.index("chin")
    fallen = np.clip((actor.layout.neutral[3 * chin + 1] - motion.points[:, chin, 1]) / 20, 0, 1)
    assert np.corrcoef(curves["Mouth_Open"], fallen)[0, 1] > 0.95
    assert np.abs(curves["Frozen"]).max() == 0
    assert (tmp_path / f"{name}.glb").stat().st_size > 1000


def test_what_was_learned_runs_without_torch(actor, tmp_path):
    import onnxruntime

    table = tmp_path / "poses.csv"
    assert run(actor.path, table, "--suggest", 8).exit_code == 0
    filled(table, actor, low=0.2)
    result = run(actor.path, table, "--export", tmp_path / "graphs")
    assert result.exit_code == 0, result.output
    session = onnxruntime.InferenceSession(tmp_path / "graphs" / "key_poses.onnx")
    motion = actor[actor.ids[1]].motion
    (weights,) = session.run(None, {"frames": motion.frames[None]})
    found = learned(read_key_poses(table, actor), actor).animation(motion)
    np.testing.assert_allclose(weights[0], found.weights, atol=1e-5)


def test_wrong_tables_end_in_one_line(actor, tmp_path):
    table = tmp_path / "poses.csv"
    assert run(actor.path, table, "--suggest", 3).exit_code == 0
    again = run(actor.path, table, "--suggest", 3)
    assert isinstance(again.exception, FacesynthError)
    assert "would be lost" in str(again.exception)
    name, out = actor.ids[0], tmp_path / "out.csv"
    for text, message in (
        ("utterance,time_s,a\n" + f"{name},0.1,0.5\n", "at least 2 key poses"),
        ("utterance,time_s,a\n" + f"{name},0.1,\n{name},0.2,1\n", "line 2: a must be a number"),
        ("utterance,time_s,a\n" + f"{name},0.1,0\n{name},900,1\n", "line 3: the recording ends"),
        ("utterance,time_s,a\n" + f"{name},0.1,0\n{name},0.1,1\n", "the same pose"),
        ("utterance,a\n" + f"{name},0.1\n", "a column for each channel"),
        ("utterance,time_s,a\n" + f"{name},0.1\n", "2 cells, but 3 columns"),
        ("utterance,time_s,a\nnobody,0.1,1\n", "nobody"),
    ):
        table.write_text(text, encoding="utf-8")
        failed = run(actor.path, table, name, "-o", out)
        assert isinstance(failed.exception, FacesynthError), (text, failed.output)
        assert message in str(failed.exception)
    assert not out.exists()
