"""Chapter 4 of the dissertation: head motion by nearest recorded movements and by hidden Markov models."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from facesynth.corpus import Utterance
from facesynth.evaluation.drawing import RECORDED, head_figure, lines_figure
from facesynth.evaluation.head import canonical_correlation, head_cca, head_distances
from facesynth.evaluation.pair import Array
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.figure import Figure, absent
from facesynth.evaluation.papers.finding import Finding, values
from facesynth.inference.head.hmm import HEARD_FPS
from facesynth.inference.head.keys import HeadKeys
from facesynth.inference.head.knn import HeadKnn
from facesynth.inference.head.voice import prosody_of
from facesynth.inference.motion import Motion
from facesynth.methods.head_hmm.method import HeadHmmMethod
from facesynth.methods.head_knn.method import HeadKnnMethod, segment_of
from facesynth.methods.head_knn.weights import Found, search_weights
from facesynth.methods.learn.heads import angles_at, poses_of, sound_windows, with_head
from facesynth.methods.method import Method
from facesynth.progress import track

PAPERS_WEIGHTS = (0.15782, 0.52463, 0.31755)
"""Wn, Wr, Wa with K = 7."""
NEIGHBOURS = (1, 2, 3, 5, 7, 10, 15)
STARTS = 20
SEGMENTS = 4
"""Recordings left out for the search of weights."""
TABLE: tuple[tuple[dict[str, Any], str], ...] = (
    ({"clusters": 16, "states": 5, "mixtures": 2}, "10.2 / 3.4 / .88 / .11"),
    ({"clusters": 16, "states": 5, "mixtures": 4}, "9.3 / 3.4 / .87 / .11"),
    ({"clusters": 16, "states": 3, "mixtures": 2}, "9.1 / 3.6 / .87 / .12"),
    ({"clusters": 16, "states": 3, "mixtures": 2, "ergodic": True}, "9.1 / 3.4 / .87 / .10"),
    ({"clusters": 16, "states": 3, "mixtures": 4, "ergodic": True}, "9.5 / 3.4 / .83 / .12"),
    ({"clusters": 32, "states": 5, "mixtures": 1}, "12.8 / 4.0 / .83 / .14"),
    ({"clusters": 32, "states": 3, "mixtures": 2}, "10.7 / 3.3 / .86 / .12"),
    ({"clusters": 32, "states": 3, "mixtures": 1, "ergodic": True}, "10.4 / 3.1 / .86 / .11"),
)
"""Configurations of table 4.1 and what the dissertation prints of them."""


SHOWN = 2
"""Row of the table that is drawn: the one that the dissertation goes on with."""


def neighbours(material: Material) -> list[Finding]:
    """§4.1, fig. 4.4 and fig. 4.5."""
    train = with_head(material.train)
    rng = np.random.default_rng(material.seed)
    left_out = rng.permutation(len(train))[: min(SEGMENTS, max(1, len(train) // 3))]
    others = material.train.subset(u.id for i, u in enumerate(train) if i not in left_out)
    near, rough, away = PAPERS_WEIGHTS
    model = HeadKnnMethod(scaled=False, near=near, rough=rough, away=away).fit(others, seed=material.seed)
    found = {k: _searched(model.speaker(), k, [train[i] for i in left_out], material.seed) for k in NEIGHBOURS}
    errors = tuple(found[k].error for k in NEIGHBOURS)
    what = "smallest total evaluation error by number of neighbours, a frame, in squared standard deviations"
    best = NEIGHBOURS[int(np.argmin(errors))]
    curve = ", ".join(f"{k}: {error:.2f}" for k, error in zip(NEIGHBOURS, errors, strict=True))
    ours = f"least at {best} ({curve})"
    picture = lines_figure({"": (NEIGHBOURS, errors)}, "neighbours K", "error (squared standard deviations)")
    seven = found[7].weights[[2, 0, 1]]
    return [
        Finding("§4.1", "31 features in 4 dimensions", "98.89 %", f"{model.facts['variance_share']:.2%}", False, material.unlike),
        Finding(
            "fig. 4.4", "weights Wa, Wn, Wr with K = 7", "0.318 / 0.158 / 0.525", values(seven.tolist()), False, material.unlike
        ),
        Finding("fig. 4.5", what, "least at 7", ours, False, material.unlike, figure=picture),
    ]


def _searched(model: HeadKnn, count: int, left_out: list[Utterance], seed: int) -> Found:
    model = replace(model, settings=replace(model.settings, neighbours=count))
    segments = [segment_of(model, u) for u in left_out]
    return search_weights(segments, model.recorded.scales, 1, STARTS, np.random.default_rng(seed))


def through_key_poses(material: Material) -> list[Finding]:
    """Fig. 4.6: the true first and last pose of tested recordings as key poses, the dissertation's weights."""
    near, rough, away = PAPERS_WEIGHTS
    model = HeadKnnMethod(scaled=False, near=near, rough=rough, away=away).fit(material.train, seed=material.seed)
    tested = with_head(material.test)
    made = [_made(model, u, material.seed, head_keys=_ends(u)) for u in tested]
    off = np.concatenate([_off(poses, u.motion) for u, poses in zip(tested, made, strict=True)])
    what = f"Euler distance through the true first and last pose, mean and std over {len(tested)} recordings, °"
    picture = _picture(tested[0], {"nearest movements": made[0]})
    return [Finding("fig. 4.6", what, "a picture", values([off.mean(), off.std()]), False, material.unlike, figure=picture)]


def prosody(material: Material) -> list[Finding]:
    """§4.4: canonical correlation of six prosodic features with three angles, recording by recording."""
    found = []
    for utterance in (*with_head(material.train), *with_head(material.test)):
        angles = angles_at(utterance, HEARD_FPS)
        heard = prosody_of([sound_windows(utterance, HEARD_FPS, len(angles))], HEARD_FPS)
        found.append(canonical_correlation(heard, angles))
    what = "canonical correlation of pitch, energy and their differences with head angles"
    return [Finding("§4.4", what, "0.7", f"{np.mean(found):.2f}", False, material.unlike)]


def models(material: Material) -> list[Finding]:
    """Table 4.1, a row for each configuration, then what a head that rests makes of the same recordings."""
    test = with_head(material.test)
    rows = [_row(material, test, config, paper, drawn=k == SHOWN) for k, (config, paper) in enumerate(track(TABLE, "table 4.1"))]
    rest = np.concatenate([poses_of(u) for u in with_head(material.train)]).mean(axis=0)
    still = np.concatenate([_off(np.tile(rest, (len(u.motion), 1)), u.motion) for u in test])
    what = "Euler distance of a head that rests (mean, std, °)"
    return [*rows, Finding("table 4.1", what, "", values([still.mean(), still.std()]), False, "ours alone, to judge the rows by")]


def _row(material: Material, test: list[Utterance], config: Mapping[str, Any], paper: str, *, drawn: bool) -> Finding:
    model = HeadHmmMethod(**config, centred=False, noise=0.1).fit(material.train, seed=material.seed)
    made = [_made(model, u, material.seed) for u in test]
    all_off = np.concatenate([_off(poses, u.motion) for u, poses in zip(test, made, strict=True)])
    cca = [head_cca(_with(u.motion, poses), _with(u.motion, poses_of(u))) for u, poses in zip(test, made, strict=True)]
    kind = "EG" if config.get("ergodic") else "LR"
    size = f"K={config['clusters']} S={config['states']} M={config['mixtures']} {kind}"
    what = f"HMM {size}: Euler distance (mean, std, °), CCA (mean, std)"
    ours = values([float(x) for x in (all_off.mean(), all_off.std(), np.mean(cca), np.std(cca))])
    picture = _picture(test[0], {f"HMM {size}": made[0]}) if drawn else ""
    return Finding("table 4.1", what, paper, ours, False, material.unlike, figure=picture)


def _made(model: Method, utterance: Utterance, seed: int, **options: Any) -> Array:
    """[T, 6] as many poses as were recorded."""
    made = model.synthesize(utterance.speech, seed=seed, **options).head
    assert made is not None  # noqa: S101 - it moves the head
    return made.astype(np.float64)[np.minimum(np.arange(len(utterance.motion)), len(made) - 1)]


def _ends(utterance: Utterance) -> HeadKeys:
    truth = poses_of(utterance)
    return HeadKeys(np.array([0.0, (len(truth) - 1) / utterance.motion.fps]), truth[[0, -1]])


def _picture(utterance: Utterance, made: Mapping[str, Array]) -> str:
    return head_figure(utterance.motion.fps, {RECORDED: poses_of(utterance), **made})


def _off(made: Array, truth: Motion) -> Array:
    """[T] degrees."""
    return head_distances(_with(truth, made), _with(truth, np.asarray(truth.head)))


def _with(motion: Motion, poses: Array) -> Motion:
    """A motion of the head alone."""
    return replace(motion, frames=np.zeros_like(motion.frames), head=poses.astype(np.float32), eyes=None)


HEAD: tuple[Figure, ...] = (
    Figure("§4.1", "31 features in 4 dimensions; weights; error by the number of neighbours", "98.89 %; least at 7", neighbours),
    Figure("fig. 4.6", "head through two key poses", "a picture", through_key_poses),
    absent("figs 4.7, 4.12, 4.13", "frames of a head", "pictures", "no number is given; `facesynth speak` makes such frames"),
    Figure("§4.4", "canonical correlation of prosody with head angles", "0.7", prosody),
    Figure("table 4.1", "head by hidden Markov models", "9.1°, 0.87", models),
)
"""The chapter's figures."""
