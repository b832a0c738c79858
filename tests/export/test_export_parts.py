import numpy as np
import pytest
from click.testing import CliRunner
from facesynth_runtime import RuntimeInputError, load

from facesynth.cli.export import export
from facesynth.export.graph import TOLERANCE
from facesynth.export.parts import export_features
from facesynth.motion.paths import cheapest_path
from facesynth.speech.rasta_plp import RastaPlp


@pytest.fixture(scope="module")
def features(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parts") / "features"
    export_features(folder)
    return load(folder)


def test_every_audio_feature_is_a_graph_of_any_length(features):
    import torch

    assert set(features.names) == {"rasta_plp", "cepstrum", "log_mel", "mel_cepstra"}
    for name in features.names:
        assert features.manifest["graphs"][name]["parity"]["largest_relative_difference"] < TOLERANCE
    sound = (0.1 * np.random.default_rng(0).standard_normal((2, 12345))).astype(np.float32)
    wanted = RastaPlp()(torch.from_numpy(sound)).numpy()
    assert np.allclose(features["rasta_plp"](audio=sound)[0], wanted, atol=1e-5)


def test_a_shape_is_named(features):
    with pytest.raises(RuntimeInputError, match=r"audio is float32 \[100\]; wanted float32 \['batch', 'samples'\]"):
        features["rasta_plp"](audio=np.zeros(100, np.float32))
    with pytest.raises(RuntimeInputError, match="audio is float64"):
        features["rasta_plp"](audio=np.zeros((1, 100)))
    with pytest.raises(RuntimeInputError, match="no graph 'melspec'"):
        features["melspec"]


def test_the_head_is_moved_by_graphs(tmp_path):
    pytest.importorskip("anny", reason="the built-in head is not installed")
    done = CliRunner().invoke(export, ["face", "-o", str(tmp_path / "face"), "--json"])
    assert done.exit_code == 0, done.output
    face = load(tmp_path / "face")
    for name in ("deform_mesh", "deform_regions", "arkit_weights", "warp"):
        assert face.manifest["graphs"][name]["parity"]["largest_relative_difference"] < TOLERANCE
    rest = np.array(face.manifest["layout"]["neutral"])[None, None]
    weights = face["arkit_weights"](frames=np.repeat(rest, 4, axis=1), fps=np.array(30.0))[0]
    assert np.abs(weights).max() < 1e-6
    still = face["deform_mesh"](frames=rest.astype(np.float32))[0]
    assert still.shape == (1, 1, face.manifest["settings"]["vertices"], 3)
    assert np.abs(still).max() < 1e-4


def test_the_cheapest_path_is_the_cheapest_of_all():
    from itertools import product

    rng = np.random.default_rng(1)
    targets, steps = rng.random((4, 3)), rng.random((3, 3, 3))
    costs = {
        path: sum(targets[t, k] for t, k in enumerate(path)) + sum(steps[t, path[t + 1], path[t]] for t in range(3))
        for path in product(range(3), repeat=4)
    }
    path, cost = cheapest_path(targets, steps)
    assert tuple(path.tolist()) == min(costs, key=costs.get)
    assert cost == pytest.approx(min(costs.values()))
