"""What each part of the default model is worth to a stranger: python benchmarks/default_model.py STRANGER/ [--tune]

STRANGER is a corpus of somebody else, such as GRID s26. The packaged default speaks as it is, with openings as they come, without
the model of phones alone, and with neither; columns are those of `benchmarks/models_for_strangers.py`. `--tune` tries other
shares of the model of phones alone and other powers of the openings, on the first five clips and on the others.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from models_for_strangers import COLUMNS, judged, lips_of, unknown
from shapes_by_hand import share_shut

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.lips import lip_opening
from facesynth.inference.beside import Beside
from facesynth.inference.network import Network
from facesynth.inference.openings import Openings
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.methods.trained import ExportedModel
from facesynth.zoo.shelf import DEFAULT, load

SHARES, POWERS = (0.2, 0.28, 0.35), (0.5, 0.6, 0.7, 1.0)
CHOOSING = 5
"""Clips that settings were chosen on, from the first."""


def main(stranger: Path, tune: bool) -> None:
    corpus = Corpus.open(stranger)
    said, model = list(corpus), network_of(DEFAULT)
    beside, openings = model.beside, model.openings
    if beside is None or openings is None:
        raise SystemExit(f"{DEFAULT} has no model of phones alone beside it, or leaves openings as they come")
    if tune:
        print_tuning(model, beside, openings, said)
        return
    parts = {
        f"{DEFAULT}, as it is": model,
        "openings as they come": replace(model, openings=None),
        "without phones alone": replace(model, beside=None),
        "neither": replace(model, openings=None, beside=None),
    }
    print(f"| | {' | '.join(COLUMNS)} |\n|---" + len(COLUMNS) * "|---:" + "|")
    for name, one in parts.items():
        print(f"| {name} | {row(one, said)} |", flush=True)


def network_of(name: str) -> Network:
    """What speaks in a packaged network."""
    found = load(name)
    if not isinstance(found, ExportedModel) or not isinstance(found.model, Network):
        raise SystemExit(f"{name} is no packaged network")
    return found.model


def row(model: Network, said: list[Utterance]) -> str:
    heard = [replace(one, speech=unknown(one.speech)) for one in said]
    truth = [lips_of(lip_opening(one.motion), one.motion.fps) for one in said]

    def opening(speech: Speech) -> tuple:
        calm = EmotionTrack.constant(model.emotions[0], speech.phones.duration_s)
        return lip_opening(model.synthesize(replace(speech, emotions=calm))), model.fps

    return str(judged(opening, said, heard, truth, share_shut(truth, said)))


def print_tuning(model: Network, beside: Beside, openings: Openings, said: list[Utterance]) -> None:
    print(f"| share | power | clips | {' | '.join(COLUMNS)} |\n|---:|---:|---" + len(COLUMNS) * "|---:" + "|")
    for share in SHARES:
        for power in POWERS:
            one = replace(model, beside=replace(beside, share=share), openings=replace(openings, power=power))
            for clips, some in (("first five", said[:CHOOSING]), ("others", said[CHOOSING:])):
                print(f"| {share:g} | {power:g} | {clips} | {row(one, some)} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stranger", type=Path)
    parser.add_argument("--tune", action="store_true")
    options = parser.parse_args()
    main(options.stranger, options.tune)
