"""The real face of a model of followed points, beside what the camera saw of an utterance that it did not learn from.

    facesynth corpus add actor/ clips/*.mpg --points --text-file lines.csv
    python examples/beside.py actor/ ID -o beside.mp4 [--pictures folder/] [--method efase]

Learns from every other utterance of the corpus, speaks the sound of this one, and writes the drawn video on the left, the
recorded one on the right.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.points.footage import read_footage
from facesynth.corpus import Corpus
from facesynth.corpus.importers.points import kept_videos
from facesynth.face.draw.video import write_video
from facesynth.face.texture.compose import Report
from facesynth.methods.registry import create
from facesynth.stage.likeness import likeness
from facesynth.stage.speaker_pictures import speaker_of


def main() -> None:
    options = parse()
    corpus = Corpus.open(options.corpus)
    utterance = corpus[options.utterance]
    others = corpus.subset([name for name in corpus.ids if corpus[name].sentence != utterance.sentence])
    real = read_footage(kept_videos(corpus)[utterance.id]).frames

    model, speaker = create(options.method).fit(others), speaker_of(others)
    own = {} if options.noise is None else {"noise": options.noise}
    motion = model.synthesize(utterance.speech, seed=options.seed, **own)
    report = Report()
    pairs = list(beside(likeness(motion, speaker, report, options.choice), real))

    write_video(options.output, pairs, speaker.fps, utterance.speech.audio, utterance.speech.sample_rate)
    save_pictures(pairs, options.pictures)
    count = min(len(motion), len(utterance.motion))
    error = np.sqrt(np.mean((motion.frames[:count] - utterance.motion.frames[:count]) ** 2))
    print(
        f"{options.output}: {report.frames} pictures, {report.folded_triangles} folded triangles, {report.jumps} jumps between "
        f"recorded pictures, real-time factor {report.real_time_factor:.2f}; RMS error of the points {error:.2f} px"
    )


def beside(drawn: Iterator[NDArray[np.uint8]], real: NDArray[np.uint8]) -> Iterator[NDArray[np.uint8]]:
    """[h, 2 w, 3] each drawn picture and the recorded one of that time."""
    for number, picture in enumerate(drawn):
        height, width = picture.shape[:2]
        yield np.concatenate([picture, real[min(number, len(real) - 1), :height, :width]], axis=1)


def save_pictures(pairs: list[NDArray[np.uint8]], folder: Path | None) -> None:
    if folder is None:
        return
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    for number, pair in enumerate(pairs):
        Image.fromarray(pair).save(folder / f"{number:04d}.png")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("corpus", type=Path)
    parser.add_argument("utterance", help="id of the utterance to be said")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--pictures", type=Path, help="folder for the single pictures (PNG)")
    parser.add_argument("--choice", choices=["coherent", "nearest"], default="coherent")
    parser.add_argument("--method", default="lds", help="lds, efase, anime_graph, network, …")
    parser.add_argument("--noise", type=float, help="how much of it, of methods that draw some")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


if __name__ == "__main__":
    main()
