"""Train eyes on a corpus, compare what they grow with recordings left out, save the model.

python train/eyes.py CORPUS [--lids CORPUS] [-o eyes.safetensors] [--config configs/eyes.yaml] [patch_s=0.5 …]

--lids names a corpus that lends its lids, where the eyes of CORPUS were recorded without.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.config import settings_of, training_parser
from facesynth.corpus import Corpus
from facesynth.corpus.eyes import recorded_eyes
from facesynth.device import device_of
from facesynth.evaluation.eyes import Samples, blink_statistics, distances, fixation_statistics, pooled
from facesynth.inference.arrays import Floats
from facesynth.methods.eyes.method import Eyes
from facesynth.methods.eyes.recordings import whole_pieces
from facesynth.motion.lids import Lids, eyes_of

CONFIG = Path(__file__).parents[1] / "configs" / "eyes.yaml"
LEAST_S = 1.0
"""Of a recording that is compared with."""


def measured(opening: Floats, eyes: NDArray[np.floating], fps: float) -> Samples:
    """Of lids [T, 1] and the gaze of eyes [T, 3]."""
    return {**fixation_statistics(eyes[:, 1:].astype(np.float64), fps), **blink_statistics(opening[:, 0], fps)}


def main() -> None:
    parser = training_parser(__doc__, CONFIG)
    parser.add_argument("--lids", type=Path)
    options = parser.parse_intermixed_args()

    # load
    recorded, held_out = Corpus.open(options.corpus).split(options.seed)
    lids = Corpus.open(options.lids) if options.lids else None
    settings = settings_of(options)

    # fit
    place = device_of(options.device or settings.get("device", "cpu"))
    model = Eyes.from_config(settings).to(place).fit(recorded, seed=options.seed, lids=lids)
    print(", ".join(f"{name} {value}" for name, value in model.facts.items()))

    # evaluate: Kolmogorov-Smirnov distances, for heads that move as those of the recordings do
    own, made = [], []
    pieces = [piece for motion, _ in recorded_eyes(held_out) for piece in whole_pieces(motion, LEAST_S)]
    shown = Lids.of(pieces)
    for number, piece in enumerate(pieces):
        grown = eyes_of(model.look(piece, seed=options.seed + number))
        own.append(measured(shown.opening(piece), eyes_of(piece), piece.fps))
        made.append(measured(grown[:, :1].astype(np.float64), grown, piece.fps))
    for name, apart in distances(pooled(made), pooled(own)).items() if own else ():
        print(f"{name}: {apart:.2f} apart")

    # save
    model.save(options.output)
    print(f"saved {options.output}")


if __name__ == "__main__":
    main()
