"""Train the linear dynamical system on a corpus, judge it on sentences left out, and save it.

python train/lds.py CORPUS [--config configs/lds.yaml] [-o lds.safetensors] [--seed 0] [key=value …] [--plots folder/]
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.config import settings_of, training_parser
from facesynth.corpus import Corpus
from facesynth.inference.speech import Speech
from facesynth.methods.lds.method import LDS
from facesynth.methods.lds.plots import plot_innovations, plot_orders
from facesynth.methods.training import train as learn
from facesynth.stage.speaker_pictures import save_face

CONFIG = Path(__file__).parents[1] / "configs" / "lds.yaml"


def main(arguments: list[str] | None = None) -> None:
    parser = training_parser(__doc__, CONFIG)
    parser.add_argument("--plots", type=Path, help="folder for plots of what was identified")
    options = parser.parse_intermixed_args(arguments)

    # Load, and leave sentences out.
    corpus = Corpus.open(options.corpus)
    train, test = corpus.split(options.seed)
    print(f"{corpus.performer} ({corpus.layout.kind}): {len(train)} utterances to learn from, {len(test)} to judge by")

    # Fit. The order and the lead are chosen on the training sentences alone.
    model = learn(LDS, train, settings_of(options), seed=options.seed, device=options.device)
    report(model)

    # Evaluate: the deterministic part, samples with noise, and the mean pose of the training sentences.
    mean = np.nanmean(train.arrays().frames, axis=0)
    rows = [errors(model, utterance.speech, utterance.motion.frames, mean) for utterance in test]
    plain, sample, still = np.sqrt(np.mean(rows, axis=0))
    unit = corpus.layout.unit
    print(f"RMS error on sentences left out: {plain:.4g} {unit} without noise, {sample:.4g} with, {still:.4g} mean pose")

    # Save; of a speaker's followed points the pictures too, from which the real face is drawn.
    model.save(options.output)
    print(f"{options.output} written")
    if face := save_face(train, options.output):
        print(f"{face} written: the speaker's pictures")

    # Draw what was identified: singular values, canonical correlations, histograms of the noise.
    if options.plots:
        plot_orders(model, options.plots / "orders.png")
        plot_innovations(model, options.plots / "innovations.png")


def errors(model: LDS, speech: Speech, truth: NDArray[np.float32], mean: NDArray[np.float32]) -> list[float]:
    """Mean squared errors of the deterministic part, of one sample and of the mean pose."""
    drawn = [model.synthesize(speech, noise=noise).frames for noise in (0.0, 1.0)]
    return [
        np.nanmean((frames[: len(truth)] - truth[: len(frames)]) ** 2) for frames in (*drawn, np.broadcast_to(mean, truth.shape))
    ]


def report(model: LDS) -> None:
    facts = model.facts
    for name in ("lead_ms", "deterministic_order", "stochastic_order"):
        choice = facts[name]
        tried = ", ".join(f"{c:g}: {e:.4g}" for c, e in zip(choice["candidates"], choice["errors"], strict=True))
        print(f"{name} = {choice['chosen']:g}" + (f"   (held-out squared error {tried})" if tried else ""))
    for name, moduli in facts["poles"].items():
        print(f"|λ({name})| = {', '.join(f'{modulus:.3f}' for modulus in moduli)}")
    if facts["repaired"]:
        print(f"unstable eigenvalues moved inside and refitted: {', '.join(f'{modulus:.3f}' for modulus in facts['repaired'])}")
    print(f"squared error one step ahead of predicting no change: {facts['no_change_error']:.4g}")
    print(f"excess kurtosis of the innovations: {', '.join(f'{k:.1f}' for k in facts['kurtosis'])}")


if __name__ == "__main__":
    main()
