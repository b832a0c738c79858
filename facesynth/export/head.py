"""Methods of the head as graphs and arrays: sound's features to components, prosody to the likelihood of states."""

import numpy as np

from facesynth.export.folder import Content
from facesynth.export.graph import Graph, Port
from facesynth.graph_builder import Builder
from facesynth.inference.head.hmm import HEARD_FPS, KEYS_PER_S
from facesynth.inference.head.voice import FEATURES, PROSODY, pitch_windows
from facesynth.inference.pitch import RATE
from facesynth.methods.head_hmm.method import HeadHmmMethod
from facesynth.methods.head_knn.method import HeadKnnMethod


def knn_content(model: HeadKnnMethod) -> Content:
    """The database and the projection into it."""
    speaker = model.speaker()
    recorded, settings = speaker.recorded, speaker.settings
    return Content(
        graphs=(projection_graph(model),),
        settings={
            "neighbours": settings.neighbours,
            "weights": list(settings.weights),
            "beam": settings.beam,
            "pitch_hz": recorded.pitch_hz,
        },
        latency={
            "look_ahead_s": pitch_windows(model.fps).look_ahead_s,
            "about": "frame t is heard with the sound up to t / fps + look_ahead_s; the search then waits as long as asked",
        },
        sample_rate=RATE,
        arrays={
            "frame": speaker.frame,
            "coefficients": recorded.coefficients.astype(np.float32),
            "moves": recorded.moves.astype(np.float32),
            "rest": recorded.rest.astype(np.float32),
            "move_scale": recorded.scales.move.astype(np.float32),
            "pose_scale": recorded.scales.pose.astype(np.float32),
        },
        units={"frame": model.fitted_layout.unit, "coefficients": "standard deviations"}
        | dict.fromkeys(("moves", "rest", "move_scale", "pose_scale"), "rad, mm"),
    )


def projection_graph(model: HeadKnnMethod) -> Graph:
    """Features [B, T, 31] to coefficients [B, T, D] (eq. 4.1)."""
    width = model.feature_basis.shape[1]
    b = Builder("project")
    features = b.input("features", "float32", ("batch", "frames", FEATURES))
    away = b.op("Sub", features, b.constant(model.feature_mean.cpu().numpy()))
    b.output(
        b.op("MatMul", away, b.constant(model.feature_basis.cpu().numpy())), "coefficients", "float32", ("batch", "frames", width)
    )
    spread = model.feature_mean.cpu().numpy()
    return Graph(
        "project",
        "pitch, formants, cepstra and predictors to the principal components in which neighbours are near",
        b.model(),
        (Port("features", "float32", ("batch", "frames", FEATURES), "Hz, 1", model.fps),),
        (Port("coefficients", "float32", ("batch", "frames", width), "standard deviations", model.fps),),
        lambda batch, count, rng: {"features": (spread * (1 + rng.standard_normal((batch, count, FEATURES)))).astype(np.float32)},
        lambda arrays: model.speaker().project(**arrays),
    )


def hmm_content(model: HeadHmmMethod) -> Content:
    """The network, the clusters and the densities."""
    speaker = model.speaker()
    return Content(
        graphs=(likelihood_graph(model),),
        settings={"heard_fps": HEARD_FPS, "keys_per_s": KEYS_PER_S},
        latency={"look_ahead_s": None, "about": "the way through the network is that of the whole utterance"},
        sample_rate=RATE,
        arrays={
            "frame": speaker.frame,
            "log_start": speaker.network.log_start.astype(np.float32),
            "log_step": speaker.network.log_step.astype(np.float32),
            "clusters": speaker.network.clusters,
            "means": speaker.means.astype(np.float32),
            "spreads": speaker.spreads.astype(np.float32),
        },
        units={"frame": model.fitted_layout.unit, "means": "rad", "spreads": "rad"},
    )


def likelihood_graph(model: HeadHmmMethod) -> Graph:
    """Prosody [B, T, 6] to the log likelihood [B, T, N] of all states.

    Of a diagonal Gaussian: log w - (sum log 2 pi v + x² / v - 2 x m / v + m² / v) / 2, two matrix products for all parts at once.
    """
    weights, means, variances = (
        getattr(model, name).cpu().numpy().astype(np.float64) for name in ("log_weights", "mixture_means", "mixture_variances")
    )
    scale = model.prosody_scale.cpu().numpy().astype(np.float64)
    states, parts = weights.shape
    b = Builder("log_likelihood")
    x = b.input("prosody", "float32", ("batch", "frames", PROSODY))
    scaled = b.op("Div", x, b.constant(scale, "float32"))
    fixed = weights - 0.5 * (np.log(2 * np.pi * variances) + means**2 / variances).sum(axis=2)
    bent = b.op("MatMul", b.op("Mul", scaled, scaled), b.constant(-0.5 / variances.reshape(-1, PROSODY).T, "float32"))
    straight = b.op("MatMul", scaled, b.constant((means / variances).reshape(-1, PROSODY).T, "float32"))
    both = b.op("Add", b.op("Add", bent, straight), b.constant(fixed.ravel(), "float32"))
    apart = b.op("Reshape", both, b.ints(0, 0, states, parts))
    b.output(b.op("ReduceLogSumExp", apart, b.ints(-1), keepdims=0), "log_likelihood", "float32", ("batch", "frames", states))
    return Graph(
        "log_likelihood",
        "pitch and energy with their differences to the likelihood of each state of all models",
        b.model(),
        (Port("prosody", "float32", ("batch", "frames", PROSODY), "standard deviations of the speaker", HEARD_FPS),),
        (Port("log_likelihood", "float32", ("batch", "frames", states), "none", HEARD_FPS),),
        lambda batch, count, rng: {"prosody": (scale * rng.standard_normal((batch, count, PROSODY))).astype(np.float32)},
        lambda arrays: model.speaker().log_likelihood(**arrays),
    )
