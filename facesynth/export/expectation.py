"""What a soft model expects to hear and see: the small network behind `pose_weight`, and the sounds of recorded phones."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.builder import Builder
from facesynth.export.graph import Arrays, Graph, Port
from facesynth.inference.efase.exported import SOUND
from facesynth.methods.efase.audio import PhoneSound
from facesynth.methods.learn.expectation import PosePredictor
from facesynth.methods.learn.hearing import Hearing
from facesynth.methods.learn.network import RATE


def expectation_graph(predictor: PosePredictor, unit: str) -> Graph:
    """Bands, phones and emotions [B, T, W] to expected coordinates [B, T, D]."""
    layers = [layer for layer in predictor.network if isinstance(layer, torch.nn.Conv1d)]
    wide, narrow = layers[0].weight.shape[1], layers[-1].weight.shape[0]
    b = Builder("expectation")
    heard = Port("heard", "float32", ("batch", "frames", wide), "standardised", RATE)
    value = b.op("Transpose", b.input(heard.name, heard.dtype, heard.shape), perm=[0, 2, 1])
    for number, layer in enumerate(layers):
        value = b.op("Relu", value) if number else value
        value = _convolved(b, value, layer)
    value = b.op("Mul", b.op("Transpose", value, perm=[0, 2, 1]), b.constant(predictor.scale.cpu().numpy()))
    poses = Port("poses", "float32", ("batch", "frames", narrow), f"components of {unit}", RATE)
    b.output(value, poses.name, poses.dtype, poses.shape)

    def example(batch: int, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        return {"heard": rng.standard_normal((batch, count, wide)).astype(np.float32)}

    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        with torch.no_grad():
            predicted = predictor.network(torch.from_numpy(arrays["heard"]).transpose(1, 2)).transpose(1, 2)
            return [(predicted * predictor.scale).numpy()]

    about = "the pose that sound, phones and emotion lead one to expect"
    return Graph("expectation", about, b.model(), (heard,), (poses,), example, reference)


def _convolved(b: Builder, value: str, layer: torch.nn.Conv1d) -> str:
    dilation = int(layer.dilation[0])
    reach = dilation * (int(layer.kernel_size[0]) - 1)
    weight, bias = (b.constant(part.detach().cpu().numpy()) for part in (layer.weight, layer.bias))  # type: ignore[union-attr]
    return b.op("Conv", value, weight, bias, dilations=[dilation], pads=[reach // 2, reach - reach // 2])


def predictor_arrays(predictor: PosePredictor) -> dict[str, NDArray[Any]]:
    """What stands beside the graph."""
    return _standard(predictor.hearing, "expectation") | {"pose_metric": predictor.metric.cpu().numpy()}


def sound_arrays(sound: PhoneSound) -> dict[str, NDArray[Any]]:
    """What phones sound like."""
    kept = sound.sounds()
    return {f"sound_{name}": getattr(kept, name) for name in SOUND} | _standard(sound.hearing, "sound")


def _standard(hearing: Hearing, name: str) -> dict[str, NDArray[Any]]:
    """Mean and deviation [40] of the bands."""
    return {f"{name}_mean": hearing.mean.cpu().numpy(), f"{name}_deviation": hearing.deviation.cpu().numpy()}
