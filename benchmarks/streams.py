"""What it costs a network to hear a stream: `python benchmarks/streams.py STRANGER/ [MODEL …]`.

STRANGER is a corpus of somebody else; MODEL a network, by its name or file, that can be streamed (the default model unless
given). Printed are how late a frame comes, the mean correlation of the lips' opening with the stranger's own from the first to
the last phone, how far the openings of the stream are from those of the whole sound (correlation with them), and processor time
over the length of the sound: for the whole sound with nothing known, with the words known, and without the parts of the model
that a stream does without; and for streams whose windows reach so far ahead.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
from models_for_strangers import correlation, cut, lips_of, spoken, unknown
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.lips import lip_opening
from facesynth.inference.motion import Motion
from facesynth.inference.network import Network
from facesynth.inference.sound import resample
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.methods.trained import ExportedModel
from facesynth.zoo.shelf import load

RATE, PIECE = 16000, 800
AHEAD_S = (0.1, 0.2, 0.4, 0.8)
Speaker = Callable[[Speech], Motion]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stranger", type=Path)
    parser.add_argument("models", nargs="*", default=["grid-s1-network"])
    options = parser.parse_args()
    said = list(Corpus.open(options.stranger))
    heard = [replace(u, speech=unknown(u.speech)) for u in said]
    for name in options.models:
        report(name, said, heard)


def report(name: str, said: list[Utterance], heard: list[Utterance]) -> None:
    model = load(name)
    speaker = model.model if isinstance(model, ExportedModel) else model.speaker()
    assert isinstance(speaker, Network)
    print(
        f"{name}, {len(said)} clips\n\n| | late, s | in speech | with the whole | real-time factor |\n|---|---:|---:|---:|---:|"
    )
    truth = [lips_of(lip_opening(u.motion), u.motion.fps) for u in said]
    whole = row("the whole, nothing known", "", speaker.synthesize, heard, truth, None)
    row("the whole, words known", "", speaker.synthesize, said, truth, whole)
    row("the whole, by what a stream has", "", as_streamed(speaker).synthesize, heard, truth, whole)
    for ahead_s in AHEAD_S:
        late_s = f"{speaker.late_s(ahead_s):.2f}"
        row(f"a stream, windows {ahead_s} s ahead", late_s, streamed(speaker, ahead_s), heard, truth, whole)


def row(
    name: str, late_s: str, speak: Speaker, clips: list[Utterance], truth: list[Motion], whole: list[Motion] | None
) -> list[Motion]:
    def opening(speech: Speech) -> tuple[NDArray[np.float64], float]:
        motion = speak(replace(speech, emotions=EmotionTrack.constant("neutral", speech.phones.duration_s)))
        return lip_opening(motion), motion.fps

    began = process_time()
    made = spoken(opening, clips)
    factor = (process_time() - began) / sum(len(u.speech.audio) / u.speech.sample_rate for u in clips)
    inside = cut(made, clips)
    alike = 1.0 if whole is None else correlation(inside, cut(whole, clips))
    print(f"| {name} | {late_s} | {correlation(inside, cut(truth, clips)):.3f} | {alike:.3f} | {factor:.3f} |", flush=True)
    return made


def as_streamed(speaker: Network) -> Network:
    """Without what needs the whole utterance, or phones."""
    return replace(speaker, sharpening=0.0, closed_gap=np.inf, openings=None, beside=None, residual=None)


def streamed(speaker: Network, ahead_s: float, piece: int = PIECE) -> Speaker:
    """Sound in pieces of so many samples."""

    def speak(speech: Speech) -> Motion:
        stream = speaker.stream(ahead_s=ahead_s)
        sound = resample(speech.audio, speech.sample_rate, RATE)
        frames = [stream.push(sound[at : at + piece]) for at in range(0, len(sound), piece)]
        return Motion(np.concatenate([*frames, stream.finish()]), speaker.fps, speaker.layout)

    return speak


if __name__ == "__main__":
    main()
