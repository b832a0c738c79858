"""The audio features as graphs. All take sound that is already at their rate; sums are in float64 where logarithms follow."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.graph import Arrays, Graph, Port
from facesynth.graph_builder import Builder, power_spectrum
from facesynth.inference.contours import FFT, HOP, SMALLEST_POWER, WINDOW
from facesynth.inference.pitch import RATE
from facesynth.methods.parts import part
from facesynth.speech.cepstrum import SMALLEST_MAGNITUDE, RealCepstrum
from facesynth.speech.mel import FLOOR, LogMel
from facesynth.speech.mel_cepstra import BANDS, CEPSTRA, MelCepstra
from facesynth.speech.rasta_plp import ROUNDING_POWER, RastaPlp

END = 2**62
SAMPLES_EACH = 400
"""Of test signals, for one unit of length."""


def rasta_plp_graph(plp: RastaPlp) -> Graph:
    """Sound [B, S] to RASTA-PLP cepstra [B, 1 + S // hop, order + 1]."""
    b = Builder("rasta_plp")
    audio = b.op("Cast", b.input("audio", "float32", ("batch", "samples")), to=11)
    length = len(plp.window)
    frames = _framed(b, audio, length, plp.hop, length // 2)
    energies = _log_energies(b, frames, plp)
    first = b.span(energies, 1, 0, 1)
    silence = b.op("Mul", b.op("Squeeze", first, b.ints(1)), b.constant(0.0, "float64"))
    filtered, _, _ = _rasta(b, energies, b.op("Concat", first, first, first, first, axis=1), silence, plp)
    port = Port("cepstra", "float32", ("batch", "frames", plp.order + 1), "none", plp.fps)
    b.output(_cepstra(b, filtered, plp), port.name, port.dtype, port.shape)
    return _of_sound(b, "RASTA-PLP cepstra, frame k centred on k / rate seconds", port, plp.sample_rate, plp)


def rasta_plp_stream_graph(plp: RastaPlp) -> Graph:
    """The same for windows of sound [B, T, L] that come in pieces, the filter's state handed on.

    `fresh` is 1 for the first piece, which is taken to have begun long ago, and 0 for those after it.
    """
    b, length, bands = Builder("rasta_plp"), len(plp.window), plp.bands.shape[1]
    inputs = (
        Port("windows", "float32", ("batch", "frames", length), "full scale 1", plp.sample_rate),
        Port("history", "float64", ("batch", 4, bands), "log energies of the frames before"),
        Port("level", "float64", ("batch", bands), "last output of the filter"),
        Port("fresh", "float64", (), "0 or 1"),
    )
    windows, history, level, fresh = (b.input(port.name, port.dtype, port.shape) for port in inputs)
    energies = _log_energies(b, b.op("Cast", windows, to=11), plp)
    first = b.span(energies, 1, 0, 1)
    begun = b.op("Concat", first, first, first, first, axis=1)
    before = b.op("Where", b.op("Greater", fresh, b.constant(0.5)), begun, history)
    filtered, held, leaked = _rasta(b, energies, before, b.op("Mul", level, b.op("Sub", b.constant(1.0), fresh)), plp)
    outputs = (
        Port("cepstra", "float32", ("batch", "frames", plp.order + 1), "none", plp.fps),
        Port("history_after", "float64", ("batch", 4, bands), "log energies"),
        Port("level_after", "float64", ("batch", bands), "none"),
    )
    for value, port in zip((_cepstra(b, filtered, plp), held, leaked), outputs, strict=True):
        b.output(value, port.name, port.dtype, port.shape)

    def example(batch: int, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        frames = (0.1 * rng.standard_normal((batch, count, length))).astype(np.float32)
        state = {"history": rng.normal(-5, 3, (batch, 4, bands)), "level": rng.standard_normal((batch, bands))}
        return {"windows": frames, **state, "fresh": np.array(float(rng.random() < 0.5))}

    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        frames = torch.from_numpy(arrays["windows"]).double()
        power = torch.fft.rfft(frames * plp.window, plp.fft).abs() ** 2 + ROUNDING_POWER * plp.window.square().sum()
        energies = (power @ plp.bands).log()
        filtered = plp.filter_along_time(energies)[0] if arrays["fresh"] else _continued(plp, energies, arrays)
        cepstra = plp.cepstra(torch.exp((filtered + plp.loudness.log()) / 3))
        return [cepstra.float().numpy(), energies[:, -4:].numpy(), filtered[:, -1].numpy()]

    return Graph(b.name, "RASTA-PLP cepstra of windows, with the filter's state", b.model(), inputs, outputs, example, reference)


def _continued(plp: RastaPlp, energies: torch.Tensor, arrays: Arrays) -> torch.Tensor:
    """What the RASTA filter gives after four frames of history, its last output decaying."""
    from scipy.signal import lfilter

    pole = float(plp.rasta[-1] / plp.rasta[-2])
    held = np.concatenate([arrays["history"], energies.numpy()], axis=1)
    driven = lfilter([0.2, 0.1, 0.0, -0.1, -0.2], [1.0], held, axis=1)[:, 4:]
    filtered, _ = lfilter([1.0], [1.0, -pole], driven, axis=1, zi=pole * arrays["level"][:, None])
    return torch.from_numpy(filtered)


def _log_energies(b: Builder, frames: str, plp: RastaPlp) -> str:
    power = power_spectrum(b, frames, plp.window.numpy(), np.arange(plp.fft // 2 + 1), plp.fft, "float64")
    floor = ROUNDING_POWER * float(plp.window.square().sum())
    return b.op("Log", b.op("MatMul", b.op("Add", power, b.constant(floor, "float64")), b.constant(plp.bands.numpy())))


def cepstrum_graph(cepstrum: RealCepstrum, sample_rate: int) -> Graph:
    """Sound [B, S] as one frame to the first coefficients of its real cepstrum [B, coefficients]."""
    b = Builder("cepstrum")
    audio = b.op("Cast", b.input("audio", "float32", ("batch", "samples")), to=11)
    least, size = b.ints(2 * cepstrum.coefficients), b.shape_of(audio, 1)
    long_enough = b.op("Max", least, size)
    even = b.op("Add", long_enough, b.op("Mod", long_enough, b.ints(2)))
    padded = b.op("Pad", audio, b.op("Concat", b.ints(0, 0, 0), b.op("Sub", even, size), axis=0))
    spectrum = b.op("DFT", b.op("Unsqueeze", padded, b.ints(-1)), "", b.constant(1, "int64"), onesided=0)
    power = b.op("ReduceSum", b.op("Mul", spectrum, spectrum), b.ints(-1), keepdims=1)
    magnitude = b.op("Max", b.op("Sqrt", power), b.constant(SMALLEST_MAGNITUDE, "float64"))
    back = b.op("DFT", b.op("Log", magnitude), "", b.constant(1, "int64"), inverse=1, onesided=0)
    first = b.span(b.op("Squeeze", b.span(back, 2, 0, 1), b.ints(-1)), 1, 0, cepstrum.coefficients)
    port = Port("cepstrum", "float64", ("batch", cepstrum.coefficients), "none")
    b.output(first, port.name, port.dtype, port.shape)

    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        return [cepstrum(torch.from_numpy(arrays["audio"]).double()).numpy()]

    sound = Port("audio", "float32", ("batch", "samples"), "full scale 1", sample_rate)
    return Graph("cepstrum", "real cepstrum of a whole sound", b.model(), (sound,), (port,), _short_sound, reference)


def log_mel_graph(mel: LogMel) -> Graph:
    """Sound [B, S] to log energies in mel bands [B, 1 + S // hop, bands]."""
    b = Builder("log_mel")
    audio = b.input("audio", "float32", ("batch", "samples"))
    length = len(mel.window)
    frames = _framed(b, audio, length, mel.hop, length // 2)
    window = mel.window.numpy() / np.sqrt(float(mel.window.square().sum()))
    power = power_spectrum(b, frames, window, np.arange(mel.fft // 2 + 1), mel.fft, "float32")
    energies = b.op("Add", b.op("MatMul", power, b.constant(mel.filters.numpy())), b.constant(FLOOR, "float32"))
    port = Port("log_mel", "float32", ("batch", "frames", mel.bands), "log energy", mel.fps)
    b.output(b.op("Log", energies), port.name, port.dtype, port.shape)
    return _of_sound(b, "natural logarithm of the energy in mel bands", port, mel.sample_rate, mel)


def mel_cepstra_graph(mel: MelCepstra) -> Graph:
    """Sound [B, S] at 16 kHz to power [B, T, 257], log mel bands [B, T, 40] and cepstra [B, T, 20], as emotions are read from."""
    b = Builder("mel_cepstra")
    audio = b.op("Cast", b.input("audio", "float32", ("batch", "samples")), to=11)
    frames = _framed(b, audio, WINDOW, HOP, WINDOW // 2)
    power = power_spectrum(b, frames, mel.window.cpu().numpy(), np.arange(FFT // 2 + 1), FFT, "float64")
    bands = b.op("Add", b.op("MatMul", power, b.constant(mel.filters.cpu().numpy())), b.constant(SMALLEST_POWER, "float64"))
    bands = b.op("Log", bands)
    cepstra = b.op("MatMul", bands, b.constant(mel.cosines.cpu().numpy()))
    widths = (("power", FFT // 2 + 1, "power"), ("bands", BANDS, "log power"), ("cepstra", CEPSTRA, "none"))
    outputs = tuple(Port(name, "float64", ("batch", "frames", width), unit, RATE / HOP) for name, width, unit in widths)
    for value, port in zip((power, bands, cepstra), outputs, strict=True):
        b.output(value, port.name, port.dtype, port.shape)
    sound = Port("audio", "float32", ("batch", "samples"), "full scale 1", RATE)
    reference = part(mel, mel.window.device)
    return Graph(
        "mel_cepstra", "mel bands and cepstra (MFCC)", b.model(), (sound,), outputs, _sound, lambda arrays: reference(**arrays)
    )


def _of_sound(b: Builder, about: str, port: Port, sample_rate: int, module: torch.nn.Module) -> Graph:
    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        with torch.no_grad():
            return [module(torch.from_numpy(arrays["audio"])).numpy()]

    sound = Port("audio", "float32", ("batch", "samples"), "full scale 1", sample_rate)
    return Graph(b.name, about, b.model(), (sound,), (port,), _sound, reference)


def _sound(batch: int, length: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
    return {"audio": (0.1 * rng.standard_normal((batch, SAMPLES_EACH * length + 7))).astype(np.float32)}


def _short_sound(batch: int, length: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
    return {"audio": (0.1 * rng.standard_normal((batch, 60 * length + 7))).astype(np.float32)}


def _framed(b: Builder, audio: str, length: int, hop: int, before: int) -> str:
    """[B, 1 + S // hop, length] windows that start at multiples of `hop`, `before` zeros standing before the sound."""
    size = b.shape_of(audio, 1)
    count = b.op("Add", b.op("Div", size, b.ints(hop)), b.ints(1))
    padded = b.op("Pad", audio, b.ints(0, before, 0, length + hop))
    one = b.op("Squeeze", count)
    starts = b.op("Mul", b.op("Range", b.constant(0, "int64"), one, b.constant(1, "int64")), b.constant(hop, "int64"))
    places = b.op("Add", b.op("Unsqueeze", starts, b.ints(1)), b.constant(np.arange(length)[None], "int64"))
    return b.op("Gather", padded, places, axis=1)


def _rasta(b: Builder, energies: str, history: str, level: str, plp: RastaPlp) -> tuple[str, str, str]:
    """The filter along time [B, T, bands], after four frames of history and an output; and both after it.

    H(z) = (0.2 + 0.1 z⁻¹ - 0.1 z⁻³ - 0.2 z⁻⁴) / (1 - pole z⁻¹). At rest on a constant the output is 0, since H(1) = 0.
    """
    pole = float(plp.rasta[-1] / plp.rasta[-2])
    held = b.op("Concat", history, energies, axis=1)
    taps = (0.2, 0.1, 0.0, -0.1, -0.2)
    size = b.shape_of(energies, 1)
    parts = []
    for k, tap in enumerate(taps):
        if tap:
            start = b.ints(4 - k)
            parts.append(b.op("Mul", b.op("Slice", held, start, b.op("Add", start, size), b.ints(1)), b.constant(tap, "float64")))
    driven = b.op("Transpose", b.op("Sum", *parts), perm=[1, 0, 2])
    body = Builder("leak")
    y, x = (body.input(name, "float64", ("batch", "bands")) for name in ("y", "x"))
    leaked = body.op("Add", body.op("Mul", y, body.constant(pole, "float64")), x)
    body.output(leaked, "y_next", "float64", ("batch", "bands"))
    body.output(leaked, "y_here", "float64", ("batch", "bands"))
    last, filtered = b.ops("Scan", 2, level, driven, body=body.graph(), num_scan_inputs=1)
    return b.op("Transpose", filtered, perm=[1, 0, 2]), b.span(held, 1, -4, 2**62), last


def _cepstra(b: Builder, filtered: str, plp: RastaPlp) -> str:
    """Filtered energies to lifted cepstra: autocorrelation, Levinson-Durbin and the recursion to cepstra, written out."""
    auditory = b.op("Exp", b.op("Div", b.op("Add", filtered, b.constant(np.log(plp.loudness.numpy()))), b.constant(3.0)))
    bands, p = plp.bands.shape[1], plp.order
    inner = b.span(auditory, 2, 1, bands - 1)
    spectrum = b.op("Concat", b.span(inner, 2, 0, 1), inner, b.span(inner, 2, bands - 3, bands - 2), axis=2)
    mirrored = np.vstack([np.eye(bands), np.eye(bands)[1:-1][::-1]])
    transform = np.cos(2 * np.pi * np.outer(np.arange(p + 1), np.arange(len(mirrored))) / len(mirrored)) / len(mirrored)
    r = b.op("MatMul", spectrum, b.constant((transform @ mirrored).T))
    lag = b.ops("Split", p + 1, r, axis=2, num_outputs=p + 1)
    error, a = lag[0], [b.op("Div", lag[0], lag[0])]
    for m in range(1, p + 1):
        total = b.op("Sum", *(b.op("Mul", a[k], lag[m - k]) for k in range(m)))
        reflection = b.op("Neg", b.op("Div", total, error))
        a = [
            a[0],
            *(b.op("Add", a[k], b.op("Mul", reflection, a[m - k])) for k in range(1, m)),
            b.op("Mul", reflection, a[0]),
        ]
        error = b.op("Sub", error, b.op("Mul", error, b.op("Mul", reflection, reflection)))
    cepstra = [b.op("Log", error)]
    for n in range(1, p + 1):
        terms = [a[n]] + [b.op("Mul", b.op("Mul", cepstra[k], a[n - k]), b.constant(k / n, "float64")) for k in range(1, n)]
        cepstra.append(b.op("Neg", b.op("Sum", *terms)))
    lifter = np.arange(p + 1.0) ** plp.lift
    lifter[0] = 1.0
    return b.op("Cast", b.op("Mul", b.op("Concat", *cepstra, axis=2), b.constant(lifter)), to=1)
