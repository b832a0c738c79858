"""Near and lively: searches and the network beside each other on the same clips of one talker, each as lively as the other.

python benchmarks/frontier.py CORPUS -o FOLDER

A fifth of the sentences is tested; of the others a fifth says how much lips must be sharpened to move as recorded, and the rest
is learned from. The network that is trained is kept in FOLDER and taken from there by the next run. Every row stands there as it
comes, and with lips closed at p, b and m by the same step for all. Differences are tested clip by clip (Wilcoxon, Holm).
"""

import argparse
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path

import numpy as np
from scipy.stats import wilcoxon

from facesynth.config import load_config
from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve
from facesynth.evaluation.lips import closure_rate, closure_threshold, false_closure_rate
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.paired import holm
from facesynth.evaluation.sync import SyncJudge
from facesynth.evaluation.two_sample import two_sample
from facesynth.inference.closures import close_at
from facesynth.inference.filters import sharpen
from facesynth.inference.lips import bilabial_spans
from facesynth.inference.motion import Motion
from facesynth.inference.residual import main_emotion
from facesynth.methods.efase.method import Efase
from facesynth.methods.learn.point_loss import lip_points
from facesynth.methods.learn.residual import Residual
from facesynth.methods.learn.sharpening import matching_share
from facesynth.methods.network.method import Network
from facesynth.methods.registry import load

SOFT = Path(__file__).parents[1] / "configs" / "efase_soft.yaml"
HELD_OUT = 0.2
Motions = dict[str, Motion]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    rest, tested = next(iter(corpus.folds(5, options.seed)))
    order = np.random.default_rng(5 + options.seed).permutation(len(rest.ids))
    count = round(HELD_OUT * len(order))
    held_out, learned = (corpus.subset([rest.ids[i] for i in part]) for part in (order[:count], order[count:]))
    print(f"{len(learned)} clips to learn from, {len(held_out)} to sharpen by, {len(tested)} tested\n", flush=True)

    network = trained(options.output, learned, options.seed)
    searches = soft_efase(network, learned, options.seed)
    residual = Residual()
    residual.learn(learned)
    beside = residual.motion(corpus.fps, 1.0)

    def spoken(model: Network | Efase, some: Corpus) -> Motions:
        return {u.id: model.synthesize(u.speech) for u in some}

    def lively(motions: Motions, share: float, added: float) -> Motions:
        made = {}
        for name, motion in motions.items():
            speech, frames = tested[name].speech, sharpen(motion.frames.astype(np.float64), share, motion.fps)
            frames += added * beside.track(speech, main_emotion(speech, corpus.emotions), motion.fps, len(motion))
            made[name] = Motion(frames.astype(np.float32), motion.fps, motion.layout)
        return made

    shares = {}
    for name, model in (("network", network), ("eFASE soft", searches)):
        pairs = [(model.synthesize(u.speech), u.motion) for u in held_out]
        shares[name] = matching_share(pairs, lip_points(corpus.layout)), matching_share(pairs)
    plain = {"network": spoken(network, tested), "eFASE soft": spoken(searches, tested)}
    rows = dict(plain)
    for name, motions in plain.items():
        rows[f"{name}, sharpened"] = lively(motions, shares[name][1], 0.0)
        rows[f"{name}, lips sharpened, residual"] = lively(motions, shares[name][0], 1.0)
    tell(rows, network.facts["closed_gap"], learned, tested)


def trained(folder: Path, learned: Corpus, seed: int) -> Network:
    """The network of a folder, or a new one that is kept there."""
    path = folder / "network.safetensors"
    if path.is_file():
        found = load(path)
        assert isinstance(found, Network)
        return found
    network = Network().fit(learned, seed=seed)
    network.save(path)
    return network


def soft_efase(network: Network, learned: Corpus, seed: int) -> Efase:
    """eFASE soft as it is before its weights are learned, not sharpened, which expects what the network does."""
    plain = {"learn": False, "sharpening": 0.0, "residual": 0.0}
    settings = {**load_config(SOFT), **plain}
    model = Efase.from_config({**settings, "pose_weight": 0.0}).fit(learned, seed=seed)
    model.audio.predictor = deepcopy(network.predictor)
    model.audio.predictor.answer_in(model.pca.encode)
    return model.with_weights(pose_weight=settings["pose_weight"])


def tell(rows: dict[str, Motions], nearest: float, learned: Corpus, tested: Corpus) -> None:
    """The table, and which rows are nearer than which."""
    judge = SyncJudge.learn(learned)
    threshold = closure_threshold((u.motion, u.speech.phones) for u in tested)
    recorded = {u.id: u.motion for u in tested}
    print("| | `lve` | energy | of the lips | closure | false | closed: `lve` | closure | false | in step | told from recorded |")
    print("|---|" + "---:|" * 10)
    errors = {}
    for name, motions in {"recorded": recorded, **rows}.items():
        shut = {u.id: closed(motions[u.id], u, nearest) for u in tested}
        own, after = (np.array([figures(m[u.id], u, threshold) for u in tested]) for m in (motions, shut))
        errors[name] = own[:, 0]
        shifts = list(in_step(judge, motions, tested))
        told = told_apart(judge, motions, recorded)
        cells = [*np.nanmean(own, axis=0), *np.nanmean(after, axis=0)[[0, 3, 4]], np.mean(np.array(shifts) == 0), told]
        print(f"| {name} | " + " | ".join(f"{cell:.3f}" if k in (0, 5) else f"{cell:.2f}" for k, cell in enumerate(cells)) + " |")
    best = "eFASE soft, lips sharpened, residual"
    others = [name for name in rows if name != best]
    chances = holm([float(wilcoxon(errors[name] - errors[best]).pvalue) for name in others])
    print(f"\n{best} is nearer than")
    for name, chance in zip(others, chances, strict=True):
        print(f"- {name}: by {np.mean(errors[name] - errors[best]):.3f}, p = {chance:.2g}")


def told_apart(judge: SyncJudge, motions: Motions, recorded: Motions) -> float:
    """How well a classifier tells lips from recorded ones; NaN where too few clips are tested."""
    try:
        return float(np.mean(list(two_sample(judge.shapes, motions, recorded).values())))
    except UnavailableError:
        return float("nan")


def figures(motion: Motion, utterance: Utterance, threshold: float) -> list[float]:
    """Lip error, energy, energy of the lips, closures, false closures."""
    phones, truth = utterance.speech.phones, utterance.motion
    rates = []
    for rate in (closure_rate, false_closure_rate):
        try:
            rates.append(rate(motion, phones, threshold))
        except UnavailableError:
            rates.append(np.nan)
    return [lve(motion, truth), energy_ratio(motion, truth), lips_energy(motion, truth), *rates]


def lips_energy(motion: Motion, truth: Motion) -> float:
    """Energy ratio of the lip points alone."""
    lips = lip_points(truth.layout)
    count = min(len(motion), len(truth))
    made, recorded = (np.linalg.norm(np.diff(m.points[:count, lips], axis=0), axis=2) for m in (motion, truth))
    present = np.isfinite(recorded)
    return float(made[present].sum() / recorded[present].sum())


def closed(motion: Motion, utterance: Utterance, nearest: float) -> Motion:
    """With lips as near at p, b and m as recorded lips mostly come."""
    spans = bilabial_spans(utterance.speech.phones, motion.fps)
    frames = close_at(motion.frames.astype(np.float64), motion.layout, spans, nearest, motion.fps)
    return Motion(frames.astype(np.float32), motion.fps, motion.layout)


def in_step(judge: SyncJudge, motions: Motions, tested: Corpus) -> Iterator[float]:
    for utterance in tested:
        try:
            yield judge.shift_ms(utterance.speech, motions[utterance.id])
        except UnavailableError:
            continue


if __name__ == "__main__":
    main()
