"""Train eFASE on a corpus, speak its held-out sentences, print the errors, save the model.

python train/efase.py CORPUS -o efase.safetensors [--config configs/efase.yaml] [penalty=3 …]
"""

import argparse
from pathlib import Path

from facesynth.config import load_config, parse_settings
from facesynth.corpus import Corpus
from facesynth.evaluation.geometry import lve, marker_error
from facesynth.methods.efase.method import Efase


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("settings", nargs="*", metavar="KEY=VALUE")
    parser.add_argument("-o", "--output", type=Path, default=Path("efase.safetensors"))
    parser.add_argument("--config", type=Path, default=Path(__file__).parents[1] / "configs" / "efase.yaml")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_intermixed_args()

    # load
    corpus = Corpus.open(options.corpus)
    learn, held_out = corpus.split(options.seed)
    settings = {**load_config(options.config), **parse_settings(options.settings)}

    # fit
    model = Efase.from_config(settings).fit(learn, seed=options.seed)
    print(f"{len(learn)} utterances, {len(model.facts['names'])} nodes, {model.facts['unusable_phones']} phones unusable")

    # evaluate
    unit = corpus.layout.unit
    for utterance in held_out:
        made = model.synthesize(utterance.speech, seed=options.seed)
        shares = model.report(utterance.speech)
        print(
            f"{utterance.id}: marker error {marker_error(made, utterance.motion):.3f} {unit}, "
            f"lips {lve(made, utterance.motion):.3f} {unit}, other phones {shares['other_phones']:.0%}, "
            f"other visemes {shares['other_visemes']:.0%}"
        )

    # save
    model.save(options.output)
    print(f"saved {options.output}")


if __name__ == "__main__":
    main()
