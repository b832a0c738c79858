"""Every module on a second device: no tensor is made on the wrong one, and what comes out is what the processor gives."""

import ast
import copy
import importlib
from pathlib import Path

import numpy as np
import pytest
import torch
from click.testing import CliRunner
from corpora import tiny_layout
from every_method import METHODS, trained_on
from second_device import DEVICE, Elsewhere, second_device
from torch import nn

import facesynth
from facesynth.cli.train import train
from facesynth.config import training_parser
from facesynth.device import device_of
from facesynth.face.deform.mesh_distance import MeshDistanceDeformer
from facesynth.face.deform.regions import RegionDeformer
from facesynth.face.rig.markers import marker_layout
from facesynth.face.solve.key_poses import KeyPoseMap, KeyPoses
from facesynth.face.texture.mesh import ringed_mesh
from facesynth.face.texture.warp import PiecewiseAffineWarp
from facesynth.inference.errors import FacesynthError
from facesynth.methods import registry
from facesynth.methods.emotion.discriminant import fit_discriminant
from facesynth.methods.emotion.svm import SvmSettings, fit_svm
from facesynth.methods.learn.point_loss import PointLoss
from facesynth.methods.learn.windows import Batch
from facesynth.motion.ica import Ica
from facesynth.motion.pca import Pca
from facesynth.motion.rbf import RbfMap
from facesynth.motion.search.cheapest import cheapest
from facesynth.motion.search.jumps import JumpSteps
from facesynth.motion.search.pictures import PictureSteps
from facesynth.speech.cepstrum import RealCepstrum
from facesynth.speech.mel import LogMel
from facesynth.speech.mel_cepstra import MelCepstra
from facesynth.speech.periodogram import Periodogram
from facesynth.speech.phone_network import phone_network
from facesynth.speech.rasta_plp import RastaPlp

ROOT = Path(facesynth.__file__).parent
RNG = np.random.default_rng(0)
WHAT_TO_DO = "tensors were left on the processor; end `fit` with `self.to(self.device)` or make each one there"
FRAMES, SOUND = torch.from_numpy(RNG.normal(size=(40, 6))).float(), torch.from_numpy(RNG.normal(0, 0.1, 8000)).float()


def rbf_map():
    return RbfMap.fit(FRAMES.numpy(), FRAMES.numpy()[:, :2], width=2.0, kernel="gaussian")


def svm(kernel):
    return fit_svm(FRAMES.double().numpy(), np.arange(40) % 3, SvmSettings(kernel))


def point_loss():
    layout = tiny_layout()
    loss = PointLoss(layout, torch.eye(layout.channels), 1.0)
    made = torch.from_numpy(RNG.normal(size=(2, 5, layout.channels))).float()
    return loss, (made, 0 * made, Batch(made, 0.5 * made, torch.ones(2, 5)))


def warp():
    points = np.stack(np.meshgrid(np.arange(8, 30, 5), np.arange(8, 24, 5)), axis=-1).reshape(-1, 2)
    mesh = ringed_mesh(points.astype(float))
    reference = torch.from_numpy(mesh.reference).float()[None]
    picture = torch.rand(1, 3, 32, 40, generator=torch.Generator().manual_seed(0))
    return PiecewiseAffineWarp(torch.from_numpy(mesh.triangles), 32, 40), (picture, reference, reference + 0.4)


def deformed(rig, deformer):
    layout = marker_layout(rig)
    rest = torch.from_numpy(rig.rest_mm[:1]).reshape(1, 3).repeat(3, len(layout.names)).float()
    return deformer(rig, layout), (rest,)


def posed_by_hand():
    layout = tiny_layout()
    frames = np.asarray(layout.neutral) + RNG.normal(0, 3, (6, layout.channels))
    poses = KeyPoses(layout, ("jawOpen", "mouthClose"), frames, RNG.uniform(size=(6, 2)))
    return KeyPoseMap.fit(poses, layout.neutral), (torch.from_numpy(frames),)


PARTS = {
    "key poses": lambda rig: posed_by_hand(),
    "pca": lambda rig: (Pca.fit(FRAMES.numpy(), 3), (FRAMES,)),
    "ica": lambda rig: (Ica.fit(RNG.uniform(size=(400, 2))), (FRAMES[:, :2],)),
    "rbf": lambda rig: (rbf_map(), (FRAMES,)),
    "real cepstrum": lambda rig: (RealCepstrum(20), (SOUND,)),
    "mel cepstra": lambda rig: (MelCepstra(), (SOUND,)),
    "log-mel": lambda rig: (LogMel(), (SOUND,)),
    "periodogram": lambda rig: (Periodogram(29.97), (SOUND, 10)),
    "phone network": lambda rig: (phone_network(), (SOUND[None],)),
    "RASTA-PLP": lambda rig: (RastaPlp(), (SOUND,)),
    "warp": lambda rig: warp(),
    "point loss": lambda rig: point_loss(),
    "mesh distance": lambda rig: deformed(rig, MeshDistanceDeformer),
    "regions": lambda rig: deformed(rig, RegionDeformer),
    "discriminant": lambda rig: (fit_discriminant(FRAMES.double().numpy(), np.arange(40) % 3), (FRAMES,)),
    "linear svm": lambda rig: (svm("linear"), (FRAMES,)),
    "radial svm": lambda rig: (svm("radial"), (FRAMES,)),
}


LOOSE = {"warp": 2e-3, "phone network": 1e-4}
"""Parts with many layers or interpolation, whose float32 sums depend on their order."""


@pytest.mark.parametrize("part", PARTS)
def test_a_module_gives_on_a_second_device_what_it_gives_on_the_processor(part, rig):
    module, given = PARTS[part](rig)
    wanted = module(*given)
    with second_device():
        moved = copy.deepcopy(module).to(DEVICE)
        made = moved(*(x.to(DEVICE) if isinstance(x, torch.Tensor | Batch) else x for x in given))
        several = isinstance(wanted, tuple)
        for there, here in zip(made if several else [made], wanted if several else [wanted], strict=True):
            assert isinstance(there, Elsewhere)
            torch.testing.assert_close(there.cpu(), here, atol=LOOSE.get(part, 1e-6), rtol=1e-5)


@pytest.mark.parametrize("name", METHODS)
def test_a_method_speaks_on_a_second_device_as_on_the_processor(name, all_trained, tiny, tmp_path):
    speech = tiny[tiny.ids[0]].speech
    all_trained[name].save(tmp_path / name)
    wanted = registry.load(tmp_path / name).synthesize(speech).frames
    with second_device():
        model = registry.load(tmp_path / name).to(DEVICE)
        assert not on_the_processor(model), f"{name}: {WHAT_TO_DO}"
        np.testing.assert_allclose(model.synthesize(speech).frames, wanted, atol=1e-3)


@pytest.mark.parametrize("name", METHODS)
def test_a_method_learns_where_its_tensors_are(name, all_trained, tiny, monkeypatch):
    speech = tiny[tiny.ids[0]].speech
    with second_device():
        model = trained_on(tiny, name, monkeypatch, DEVICE)
        assert not on_the_processor(model), f"{name}: {WHAT_TO_DO}"
        np.testing.assert_allclose(model.synthesize(speech).frames, all_trained[name].synthesize(speech).frames, atol=1e-2)


def on_the_processor(model):
    """Names of a model's tensors that are not on the second device."""
    return [name for name, tensor in model.state_dict().items() if not isinstance(tensor, Elsewhere)]


def jump_steps():
    ends, links = torch.from_numpy(RNG.normal(size=(2, 4, 1, 5, 3))), torch.tensor([[[1, -1, 0, 2, 3]]]).repeat(4, 1, 1)
    return JumpSteps(list(ends[0]), list(ends[1]), list(links), 1.0, 0.5)


def picture_steps():
    looks, numbers = torch.from_numpy(RNG.normal(size=(9, 4))), torch.from_numpy(RNG.integers(0, 9, (4, 5)))
    return PictureSteps(looks, torch.arange(9) % 4 == 0, numbers, 0.7)


SEARCHES = {"jumps": jump_steps, "pictures": picture_steps}


@pytest.mark.parametrize("search", SEARCHES)
def test_the_cheapest_path_is_the_same_on_a_second_device(search):
    steps, targets = SEARCHES[search](), list(torch.from_numpy(RNG.uniform(size=(4, 1, 5))))
    wanted = cheapest(targets, steps)
    with second_device():
        found = cheapest([target.to(DEVICE) for target in targets], steps.to(DEVICE))
        assert isinstance(found.path, Elsewhere)
        assert torch.equal(found.path.cpu(), wanted.path)
        torch.testing.assert_close(found.cost.cpu(), wanted.cost)


BY_EFASE = {"MotionNodeSteps", "MotionNodeSearch"}
"""What eFASE makes when it speaks on another device than the processor."""


def test_no_module_is_forgotten(all_trained, rig):
    tried = {type(make()) for make in SEARCHES.values()}
    tried |= {type(part) for make in PARTS.values() for part in make(rig)[0].modules()}
    tried |= {type(part) for model in all_trained.values() for part in model.modules()}
    forgotten = {kind.__qualname__ for kind in modules() - tried} - {"Method", "EmotionDetector", *BY_EFASE}
    assert not forgotten, (
        f"{sorted(forgotten)}: on a second device nobody tries them; make one in PARTS above, or switch it on in the"
        " SETTINGS of its method (tests/every_method.py)"
    )


def modules():
    """Every class of facesynth that is a torch module."""
    found = set()
    for path in ROOT.rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        if "Module)" in source or "(Method)" in source:
            module = importlib.import_module(".".join(("facesynth", *path.relative_to(ROOT).with_suffix("").parts)))
            names = [node.name for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)]
            kinds = [getattr(module, name, None) for name in names]
            found |= {kind for kind in kinds if isinstance(kind, type) and issubclass(kind, nn.Module)}
    return found


def test_the_second_device_is_told_from_the_processor():
    with second_device():
        there, here = torch.ones(3, device=DEVICE), torch.ones(3)
        assert (there + 1).cpu().tolist() == [2, 2, 2]
        with pytest.raises(AssertionError, match="on the processor"):
            there + here
        with pytest.raises(RuntimeError, match="numpy"):
            there.numpy()


def test_devices_by_name(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    assert device_of("auto") == device_of("cpu") == torch.device("cpu")
    with pytest.raises(FacesynthError, match="no device cuda here .found: none of the kind."):
        device_of("cuda")
    with pytest.raises(FacesynthError, match="did you mean cuda"):
        device_of("cudo")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    assert device_of("auto") == torch.device("cuda")
    assert device_of("cuda:1") == torch.device("cuda:1")
    with pytest.raises(FacesynthError, match="cuda:0, cuda:1"):
        device_of("cuda:2")


def test_train_says_in_one_line_that_a_device_is_not_there(tiny, tmp_path, monkeypatch):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    (tmp_path / "there.yaml").write_text("device: auto\n")
    (tmp_path / "elsewhere.yaml").write_text("device: cuda\n")
    model = tmp_path / "model.safetensors"
    with pytest.raises(FacesynthError, match="no device cuda here"):
        run("mean_face", tiny.path, "-o", model, "--config", tmp_path / "elsewhere.yaml")
    with pytest.raises(FacesynthError, match="no device cuda here"):
        run("mean_face", tiny.path, "-o", model, "--config", tmp_path / "there.yaml", "--device", "cuda")
    assert not model.exists()
    assert run("mean_face", tiny.path, "-o", model, "--config", tmp_path / "elsewhere.yaml", "--device", "cpu").exit_code == 0
    assert registry.load(model).device == torch.device("cpu")
    assert run("mean_face", tiny.path, "-o", model, "--config", tmp_path / "there.yaml").exit_code == 0


def test_every_script_that_trains_takes_a_device(repository):
    written = {path: path.read_text(encoding="utf-8") for path in (repository / "train").glob("*.py")}
    scripts = {path: said for path, said in written.items() if "facesynth.methods" in said or "torch" in said}
    assert len(scripts) > 8
    for path, said in scripts.items():
        assert '"--device"' in said or "training_parser(" in said, path.name
        assert "options.device" in said, path.name
    parsed = training_parser("", Path("configs/ridge.yaml")).parse_intermixed_args(["corpus", "a=1", "--device", "cuda", "b=2"])
    assert (parsed.device, parsed.output, parsed.settings) == ("cuda", Path("ridge.safetensors"), ["a=1", "b=2"])


def test_the_means_of_a_soft_path_are_the_same_on_a_second_device(tiny):
    """A search by tensors there, by numpy here."""
    soft = registry.create("efase", temperature=0.5, candidates=12).fit(tiny)
    speech = tiny[tiny.ids[0]].speech
    wanted = soft.plan(speech).mixtures
    with second_device():
        found = copy.deepcopy(soft).to(DEVICE).plan(speech).mixtures
    for here, there in zip(wanted, found, strict=True):
        assert (here is None) == (there is None)
        if here is not None:
            np.testing.assert_array_equal(there.nodes, here.nodes)
            np.testing.assert_allclose(there.shares, here.shares, atol=1e-9)
            np.testing.assert_allclose(there.captured, here.captured, atol=1e-9)


def run(*arguments):
    return CliRunner().invoke(train, [str(argument) for argument in arguments], catch_exceptions=False)
