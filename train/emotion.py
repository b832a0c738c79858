"""Train an emotion detector on a corpus or a list of sound files, print how well it recognises, save it.

python train/emotion.py CORPUS -o emotion.safetensors [--config configs/emotion.yaml] [normalise=true …]
python train/emotion.py recordings.csv …          (columns file,emotion,speaker,sentence)
python train/emotion.py CORPUS --table            (Table I of Cao 2005, and the chosen settings beside it)
"""

import argparse
from pathlib import Path

from facesynth.config import load_config, parse_settings
from facesynth.corpus import Corpus
from facesynth.device import device_of
from facesynth.methods.emotion.clips import clips_of_corpus, clips_of_list
from facesynth.methods.emotion.detector import DetectorSettings, EmotionDetector
from facesynth.methods.emotion.tables import SPLITS, Recognition, recognise, table_one


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, help="a corpus folder, or a CSV that lists sound files")
    parser.add_argument("settings", nargs="*", metavar="KEY=VALUE")
    parser.add_argument("-o", "--output", type=Path, default=Path("emotion.safetensors"))
    parser.add_argument("--config", type=Path, default=Path(__file__).parents[1] / "configs" / "emotion.yaml")
    parser.add_argument("--device", default="cpu", help="where the voices' features are computed: auto, cpu, cuda or mps")
    parser.add_argument("--table", action="store_true", help="reproduce Table I in form")
    options = parser.parse_intermixed_args()

    # load
    corpus = Corpus.open(options.recordings) if options.recordings.is_dir() else None
    clips = clips_of_corpus(corpus) if corpus else clips_of_list(options.recordings)
    settings = DetectorSettings.from_config({**load_config(options.config), **parse_settings(options.settings)})

    # evaluate
    detector = EmotionDetector(settings).to(device_of(options.device))
    features = detector.features_of(clips)
    splits = [s for s in SPLITS if s != "by speaker" or len({c.speaker for c in clips}) > 1]
    splits = [s for s in splits if s != "by sentence" or len({c.sentence for c in clips}) > 1]
    for split in splits:
        show(recognise(clips, settings, split, x=features), confusion=split.startswith("by"))
    if options.table:
        for row in table_one(clips, splits):
            show(row)

    # fit
    detector.fit_features(features, clips)
    detector.provenance = corpus.provenance() if corpus else {"recordings": str(options.recordings), "clips": len(clips)}

    # save
    detector.save(options.output)
    print(f"saved {options.output}: {', '.join(detector.emotions)}")


def show(result: Recognition, *, confusion: bool = False) -> None:
    """One line, and the confusion matrix if wanted."""
    settings = result.settings
    features = f"paper, {settings.coefficients} coefficients" if settings.features == "paper" else settings.features
    classifier = f"svm, {settings.kernel}" if settings.classifier == "svm" else settings.classifier
    print(f"{result.split:14s} {features}, {classifier}: accuracy {result.accuracy:.3f}, "
          f"unweighted recall {result.unweighted_recall:.3f}")  # fmt: skip
    for name, row in zip(result.emotions, result.confusion.tolist(), strict=True) if confusion else ():
        print(f"    {name:>12s} " + " ".join(f"{count:4d}" for count in row))


if __name__ == "__main__":
    main()
