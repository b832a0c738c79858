"""Learn what emotions add to a neutral face, judge it on sentences left out, and save it.

python train/expression.py CORPUS [--config configs/expression.yaml] [-o expression.safetensors] [--seed 0] [key=value …]
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from facesynth.config import settings_of, training_parser
from facesynth.corpus import Corpus
from facesynth.evaluation.geometry import marker_error
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack
from facesynth.methods.expression.differences import difference_of, says_the_same, twins
from facesynth.methods.expression.method import Expression
from facesynth.methods.training import train as learn

CONFIG = Path(__file__).parents[1] / "configs" / "expression.yaml"


def main(arguments: list[str] | None = None) -> None:
    parser = training_parser(__doc__, CONFIG)
    options = parser.parse_intermixed_args(arguments)

    # Load, and leave sentences out.
    corpus = Corpus.open(options.corpus)
    train, test = corpus.split(options.seed)
    print(f"{corpus.performer} ({corpus.layout.kind}): {len(train)} utterances to learn from, {len(test)} to judge by")

    # Fit: differences of twins, their eigenspace, the signals in it.
    model = learn(Expression, train, settings_of(options), seed=options.seed, device=options.device)
    report(model)

    # Evaluate: a recorded neutral sentence with the emotion added, against the recorded emotional one at the same timing.
    rows = []
    for neutral, felt in twins(test):
        if felt.emotion in model.emotions and says_the_same(neutral.speech.phones, felt.speech.phones):
            frames = neutral.motion.frames + difference_of(neutral, felt).frames
            truth = Motion(frames.astype(np.float32), neutral.motion.fps, neutral.motion.layout)
            said = replace(neutral.speech, emotions=EmotionTrack.constant(felt.emotion, neutral.speech.duration_s))
            made = model.express(neutral.motion, said, seed=options.seed)
            rows.append((marker_error(neutral.motion, truth), marker_error(made, truth)))
    before, after = np.mean(rows, axis=0)
    print(f"distance to the recorded emotion: {before:.4g} {corpus.layout.unit} in neutral, {after:.4g} with it added")

    # Save.
    model.save(options.output)
    print(f"{options.output} written")


def report(model: Expression) -> None:
    facts = model.facts
    for emotion, count in facts["sentences"].items():
        print(f"{emotion}: {count} sentences beside their neutral twins")
    for reason in facts["emotions_left_out"].values():
        print(f"left out: {reason}")
    if unlike := facts["other_phones"]:
        print(f"left out: {unlike} pairs whose phones are not the same")
    print(f"the eigenspace holds {facts['variance']:.1%} of the variance in {model.basis.shape[1]} dimensions")


if __name__ == "__main__":
    main()
