"""From clips of a real talker to a corpus: the GRID corpus (Cooke, Barker, Cunningham, Shao 2006, CC BY 4.0).

    python examples/grid.py path/to/clips actor/

GRID's file names are its sentences: `bbaf5a` is "bin blue at f five again". This writes them into `lines.csv` beside
the corpus and runs the one command that a performer of your own would need as well:

    facesynth corpus add actor/ clips/*.mpg --text-file lines.csv
"""

import csv
import subprocess
import sys
from pathlib import Path

WORDS = (
    {"b": "bin", "l": "lay", "p": "place", "s": "set"},
    {"b": "blue", "g": "green", "r": "red", "w": "white"},
    {"a": "at", "b": "by", "i": "in", "w": "with"},
    {"z": "zed"},
    dict(zip("z123456789", ["zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"], strict=True)),
    {"a": "again", "n": "now", "p": "please", "s": "soon"},
)
"""What each letter of a file's name stands for; the fourth is itself, in British English."""


def sentence(name: str) -> str:
    """The six words of a clip, from the six letters of its name."""
    return " ".join(words.get(letter, letter) for words, letter in zip(WORDS, name, strict=True))


def main(clips: Path, corpus: Path) -> int:
    videos = sorted(clips.glob("*.mpg"))
    if not videos:
        sys.exit(f"{clips} holds no .mpg files; give the folder of one talker of GRID")
    corpus.parent.mkdir(parents=True, exist_ok=True)
    lines = corpus.parent / f"{corpus.name}_lines.csv"
    with lines.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([("id", "text"), *((video.stem, sentence(video.stem)) for video in videos)])
    rights = ["--licence", "CC BY 4.0 (Cooke, Barker, Cunningham, Shao 2006)", "--consent", "GRID corpus, published for research"]
    facesynth = [sys.executable, "-c", "from facesynth.cli import main; main()", "corpus", "add", str(corpus)]
    return subprocess.call([*facesynth, *map(str, videos), "--text-file", str(lines), *rights])


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python examples/grid.py CLIPS CORPUS")
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
