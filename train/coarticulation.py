"""Train the co-articulation model on a corpus, judge it on sentences left out, and save it.

python train/coarticulation.py CORPUS [--config configs/coarticulation.yaml] [-o coarticulation.safetensors] [key=value …]

With --common FILE nothing is trained: the polynomials of all pairs of phones of CORPUS together are written, by which key shapes
made by hand are blended.
"""

from pathlib import Path

import numpy as np
import yaml

from facesynth.config import settings_of, training_parser
from facesynth.corpus import Corpus
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import marker_error
from facesynth.inference.coarticulation.blending import WeightModels
from facesynth.methods.coarticulation.method import Coarticulation
from facesynth.methods.training import train as learn

CONFIG = Path(__file__).parents[1] / "configs" / "coarticulation.yaml"


def main(arguments: list[str] | None = None) -> None:
    parser = training_parser(__doc__, CONFIG)
    parser.add_argument("--common", type=Path, help="YAML file to write the polynomials of all pairs to")
    options = parser.parse_intermixed_args(arguments)

    # Load, and leave sentences out.
    corpus = Corpus.open(options.corpus)
    if options.common:
        write_common(corpus, options.common)
        return
    train, test = corpus.split(options.seed)
    print(f"{corpus.performer} ({corpus.layout.kind}): {len(train)} utterances to learn from, {len(test)} to judge by")

    # Fit: key shapes of phones, and polynomials of the time by viseme class.
    model = learn(Coarticulation, train, settings_of(options), seed=options.seed, device=options.device)
    report(model)

    # Evaluate.
    made = [(model.synthesize(utterance.speech), utterance.motion) for utterance in test]
    error, energy = np.mean([(marker_error(*pair), energy_ratio(*pair)) for pair in made], axis=0)
    print(f"error on sentences left out: {error:.4g} {corpus.layout.unit}, energy {energy:.2f}")

    # Save.
    model.save(options.output)
    print(f"{options.output} written")


def report(model: Coarticulation) -> None:
    facts, models = model.facts, model.speaker().parts.models
    print(f"{facts['phone_samples']} samples of phones from {facts['recordings']} recordings")
    if missing := facts["phones_without_sample"]:
        print(f"never recorded, so they take the shape of their class: {' '.join(missing)}")
    if (gap := facts["closed_gap"]) is not None:
        print(f"lips come as near as {gap:.3g} {model.fitted_layout.unit} at p, b and m")
    print(f"triphones with polynomials of their own: {facts['triphone_models']}; the common weights of a diphone:")
    print(mean_weights(models))


def write_common(corpus: Corpus, path: Path) -> None:
    """One pair of polynomials for all pairs of phones."""
    model = Coarticulation(pull=1e12, triphones=0).fit(corpus)
    starting, ending = model.diphones[0, 0].double().numpy().round(4).tolist()
    licence = ", ".join(corpus.provenance()["licences"])
    stored = {"source": corpus.performer, "licence": licence, "starting": starting, "ending": ending}
    path.write_text(yaml.safe_dump(stored, sort_keys=False), encoding="utf-8")
    print(f"{path} written: {model.facts['phone_samples']} phones of {corpus.performer}")


def mean_weights(models: WeightModels) -> str:
    t = np.linspace(0, 1, 5)
    powers = np.vander(t, models.diphones.shape[-1], increasing=True)
    rows = zip(("first", "second"), models.diphones.mean(axis=(0, 1)) @ powers.T, strict=True)
    return "\n".join(f"  {name:6}" + "".join(f"{weight:7.2f}" for weight in weights) for name, weights in rows)


if __name__ == "__main__":
    main()
