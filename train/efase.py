"""Train eFASE on a corpus, speak its held-out sentences, print the errors, save the model.

python train/efase.py CORPUS -o efase.safetensors [--config configs/efase.yaml] [penalty=3 …]

learn=true (as in configs/efase_soft.yaml) learns the weights of the cost, a linear metric of sound and pose, and how
much to sharpen by gradient through the soft search, on sentences of CORPUS that are kept out of the database meanwhile;
what is printed at the end comes from sentences that played no part in any of it.
"""

from pathlib import Path

from facesynth.config import settings_of, training_parser
from facesynth.corpus import Corpus
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve, marker_error
from facesynth.methods.efase.method import Efase
from facesynth.methods.training import train

CONFIG = Path(__file__).parents[1] / "configs" / "efase.yaml"


def main() -> None:
    parser = training_parser(__doc__, CONFIG)
    options = parser.parse_intermixed_args()

    # load
    corpus = Corpus.open(options.corpus)
    recorded, held_out = corpus.split(options.seed)

    # fit
    model = train(Efase, recorded, settings_of(options), seed=options.seed, device=options.device)
    if told := model.facts.get("learned"):
        print(f"learned in {told['rounds']} rounds, validation error {told['improvement']:.1%} less")
        print(" ".join(f"{name}={value:.4g}" for name, value in told["settings"].items()))
    print(f"{len(recorded)} utterances, {len(model.facts['names'])} nodes, {model.facts['unusable_phones']} phones unusable")

    # evaluate
    unit, lips, energies = corpus.layout.unit, [], []
    for utterance in held_out:
        made = model.synthesize(utterance.speech, seed=options.seed)
        shares = model.report(utterance.speech)
        lips.append(lve(made, utterance.motion))
        energies.append(energy_ratio(made, utterance.motion))
        print(
            f"{utterance.id}: marker error {marker_error(made, utterance.motion):.3f} {unit}, "
            f"lips {lips[-1]:.3f} {unit}, energy {energies[-1]:.2f}, other phones {shares['other_phones']:.0%}, "
            f"other visemes {shares['other_visemes']:.0%}"
        )
    print(f"mean over {len(lips)} utterances: lips {sum(lips) / len(lips):.3f} {unit}, energy {sum(energies) / len(lips):.3f}")

    # save
    model.save(options.output)
    print(f"saved {options.output}")


if __name__ == "__main__":
    main()
