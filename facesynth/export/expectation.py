"""What a soft model expects to hear and see: the small network behind `pose_weight`, and the sounds of recorded phones."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.graph import Arrays, Graph, Port
from facesynth.export.phones import phone_net_graph
from facesynth.export.speech_graphs import log_mel_graph
from facesynth.graph_builder import Builder
from facesynth.inference.efase.exported import SOUND
from facesynth.inference.expectation import EACH
from facesynth.inference.residual import ARRAYS
from facesynth.methods.efase.audio import PhoneSound
from facesynth.methods.learn.expectation import PosePredictor
from facesynth.methods.learn.hearing import Hearing
from facesynth.methods.learn.linear_path import SIDE, LinearPath
from facesynth.methods.learn.pose_network import REACH, CausalBlock
from facesynth.methods.learn.residual import Residual


def expectation_graph(predictor: PosePredictor, unit: str) -> Graph:
    """Bands, phones and emotions [B, T, W] to expected coordinates [B, T, D]: frame t by what was told up to t."""
    network, reading = predictor.network, predictor.reading
    b = Builder("expectation")
    heard = Port("heard", "float32", ("batch", "frames", reading.width), "standardised", reading.rate)
    value = b.input(heard.name, heard.dtype, heard.shape)
    if len(network.columns):
        value = b.op("Gather", value, b.constant(network.columns.cpu().numpy()), axis=2)
    value = b.op("Transpose", value, perm=[0, 2, 1])
    value = b.op("Gelu", _causal(b, value, network.first))
    for block in network.blocks.children():
        value = b.op("Add", value, _changed(b, value, block))  # type: ignore[arg-type]  # all of them are CausalBlock
    components = _causal(b, value, network.poses)
    if predictor.linear.learned:
        share = predictor.linear.share
        own, straight = b.constant(np.float32(1 - share)), b.constant(np.float32(share))
        linear = _linear(b, heard.name, reading.width, predictor.linear, predictor.ahead)
        components = b.op("Add", b.op("Mul", components, own), b.op("Mul", linear, straight))
    poses = b.op("Transpose", components, perm=[0, 2, 1])
    value = b.op("Add", b.op("MatMul", poses, b.constant(predictor.into.cpu().numpy())), b.constant(predictor.onto.cpu().numpy()))
    port = Port("poses", "float32", ("batch", "frames", len(predictor.onto)), f"coordinates of motion in {unit}", reading.rate)
    b.output(value, port.name, port.dtype, port.shape)

    def example(batch: int, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        return {"heard": rng.standard_normal((batch, count, reading.width)).astype(np.float32)}

    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        told = torch.from_numpy(arrays["heard"]).to(predictor.scale.device)
        return [torch.stack([predictor(one) for one in told]).cpu().numpy()]

    about = "the pose that sound, phones and emotion lead one to expect"
    return Graph("expectation", about, b.model(), (heard,), (port,), example, reference)


def hearing_graphs(hearing: Hearing) -> tuple[Graph, ...]:
    """What it hears with."""
    log_mel = () if hearing.features == "phone_net" else (log_mel_graph(hearing.mel),)
    return log_mel + (() if hearing.features == "log_mel" else (phone_net_graph(int(hearing.layer)),))


def _linear(b: Builder, heard: str, width: int, linear: LinearPath, ahead: int) -> str:
    """[B, R, T] what a regression says of [B, T, W], W the width; as `LinearPath.forward`."""
    _, bands, places = linear.weight.shape
    split = b.op("Reshape", b.span(heard, 2, 0, EACH * bands), b.ints(0, 0, EACH, bands))
    sound = b.op("Transpose", b.op("ReduceMean", split, b.ints(2), keepdims=0), perm=[0, 2, 1])
    late = max(ahead - SIDE, 0)
    padded = b.op("Pad", sound, b.ints(0, 0, places - 1 + late, 0, 0, 0), b.constant(np.float32(0)))
    weight, bias = (b.constant(part.float().cpu().numpy()) for part in (linear.weight, linear.bias))
    found = b.span(b.op("Conv", padded, weight, bias), 2, 0, -late if late else 2**62)
    if not (count := len(linear.emotions)):
        return found
    felt = b.op("Pad", b.span(heard, 2, width - count, width), b.ints(0, ahead, 0, 0, 0, 0), b.constant(np.float32(0)))
    shifts = b.op("MatMul", b.span(felt, 1, 0, -ahead if ahead else 2**62), b.constant(linear.emotions.cpu().numpy()))
    return b.op("Add", found, b.op("Transpose", shifts, perm=[0, 2, 1]))


def _changed(b: Builder, value: str, block: CausalBlock) -> str:
    """What a block adds to [B, width, T]."""
    weight, bias = (b.constant(part.detach().cpu().numpy()) for part in (block.norm.weight, block.norm.bias))
    normed = b.op("LayerNormalization", b.op("Transpose", value, perm=[0, 2, 1]), weight, bias, axis=-1, epsilon=block.norm.eps)
    return _causal(b, b.op("Gelu", _causal(b, b.op("Transpose", normed, perm=[0, 2, 1]), block.spread)), block.mix)


def _causal(b: Builder, value: str, layer: torch.nn.Conv1d) -> str:
    dilation = int(layer.dilation[0])
    reach = dilation * (int(layer.kernel_size[0]) - 1)
    weight, bias = (b.constant(part.detach().cpu().numpy()) for part in (layer.weight, layer.bias))  # type: ignore[union-attr]
    return b.op("Conv", value, weight, bias, dilations=[dilation], pads=[reach, 0])


def predictor_settings(predictor: PosePredictor) -> dict[str, Any]:
    """How the graph is asked; `inference.expectation.exported_expectation` reads it."""
    reading = predictor.reading
    return {"rate": reading.rate, "phones": reading.phones, "before": REACH, "ahead": predictor.ahead}


def predictor_arrays(predictor: PosePredictor) -> dict[str, NDArray[Any]]:
    """What stands beside the graph."""
    return _standard(predictor.hearing, "expectation") | {"pose_metric": predictor.metric.cpu().numpy()}


def sound_arrays(sound: PhoneSound) -> dict[str, NDArray[Any]]:
    """What phones sound like."""
    kept = sound.sounds()
    return {f"sound_{name}": getattr(kept, name) for name in SOUND} | _standard(sound.hearing, "sound")


def _standard(hearing: Hearing, name: str) -> dict[str, NDArray[Any]]:
    """Mean and deviation [B] of the bands."""
    return {f"{name}_mean": hearing.mean.cpu().numpy(), f"{name}_deviation": hearing.deviation.cpu().numpy()}


def residual_arrays(residual: Residual | None) -> dict[str, NDArray[Any]]:
    """What moves beside the lips; nothing where a model keeps none."""
    return (
        {}
        if residual is None or not residual.any
        else {f"residual_{name}": getattr(residual, name).cpu().numpy() for name in ARRAYS}
    )
