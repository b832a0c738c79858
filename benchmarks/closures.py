"""Whether lips close where people close them: `python benchmarks/closures.py MODEL CORPUS FOLDER [--clips N]`.

FOLDER holds `grid_s1` (words known from its .align files) and `ravdess_speech` (two sentences); CORPUS is what MODEL
learned from: its recorded lip gaps at p, b, m give the threshold (see `facesynth.evaluation.lips`). Clips are taken
evenly from all. Printed are shares over all p, b, m and all open vowels of a set, and how many of them there were.
"""

import argparse
from pathlib import Path

from facesynth.corpus import Corpus
from facesynth.evaluation.lips import OPEN_VOWELS, closure_rate, closure_threshold, false_closure_rate
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import BILABIALS
from facesynth.methods.trained import TrainedModel
from facesynth.speech.hearing import hear
from facesynth.zoo.shelf import load

STATEMENTS = {"01": "Kids are talking by the door", "02": "Dogs are sitting by the door"}
FEELINGS = {"01": "neutral", "03": "happy", "04": "sad", "05": "angry"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", help="a file, or a name that `facesynth models` lists")
    parser.add_argument("corpus", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--clips", type=int, default=40)
    options = parser.parse_args()
    model = load(options.model)
    threshold = closure_threshold((u.motion, u.speech.phones) for u in Corpus.open(options.corpus))
    print(f"lips count as shut below {threshold:.2f} mm")
    for name, clips in (("grid_s1", grid(options.folder)), ("ravdess_speech", ravdess(options.folder))):
        if clips:
            report(
                name, model, [clips[i * len(clips) // options.clips] for i in range(min(options.clips, len(clips)))], threshold
            )


def grid(folder: Path) -> list[tuple[Path, str, str]]:
    """Film, words, emotion."""
    found = []
    for film in sorted((folder / "grid_s1").glob("*.mpg")):
        words = [line.split()[2] for line in film.with_suffix(".align").read_text().splitlines()]
        found.append((film, " ".join(word for word in words if word not in ("sil", "sp")), "neutral"))
    return found


def ravdess(folder: Path) -> list[tuple[Path, str, str]]:
    """Sound, words, emotion; only emotions that the model may know."""
    found = []
    for sound in sorted((folder / "ravdess_speech").rglob("*.flac")):
        _, _, feeling, _, statement, *_ = sound.stem.split("-")
        if feeling in FEELINGS:
            found.append((sound, STATEMENTS[statement], FEELINGS[feeling]))
    return found


def report(name: str, model: TrainedModel, clips: list[tuple[Path, str, str]], threshold: float) -> None:
    shut, closures, false, vowels, refused = 0.0, 0, 0.0, 0, 0
    for path, text, emotion in clips:
        try:
            speech = hear(path, text=text, emotion=emotion if emotion in model.emotions else model.emotions[0]).speech
        except FacesynthError as error:
            refused += 1
            print(f"  {path.name}: {error}")
            continue
        motion = model.synthesize(speech)
        lips = sum(label in BILABIALS for label in speech.phones.labels)
        opened = sum(label in OPEN_VOWELS for label in speech.phones.labels)
        if lips:
            shut, closures = shut + closure_rate(motion, speech.phones, threshold) * lips, closures + lips
        if opened:
            false, vowels = false + false_closure_rate(motion, speech.phones, threshold) * opened, vowels + opened
    print(f"{name}: {len(clips) - refused} clips, {refused} refused; closed on {shut:.0f} of {closures} p, b, m", end=" ")
    print(f"({shut / max(closures, 1):.2f}); shut on {false:.0f} of {vowels} open vowels ({false / max(vowels, 1):.2f})")


if __name__ == "__main__":
    main()
