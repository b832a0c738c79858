"""One complete walk: clips of a talker → corpus → check → training → a sentence that was not learned from → video,
and that video beside the real one.

    python examples/walk.py path/to/grid_s26 walk/

The clips are those of one talker of the GRID corpus (Cooke, Barker, Cunningham, Shao 2006, CC BY 4.0), whose names are their
sentences; with a folder of your own clips, write `lines.csv` (`id,text`) into it and it is used instead. Every step
prints the command that a person would type. Needs `pip install 'facesynth[demo,capture]'` and, once, `facesynth fetch landmarks`.
"""

import csv
import shlex
import subprocess
import sys
from pathlib import Path

from grid import sentence
from side_by_side import side_by_side

SUFFIXES = (".mpg", ".mp4", ".mov", ".mkv")


def main(clips: Path, folder: Path) -> None:
    videos = sorted(path for path in clips.iterdir() if path.suffix.lower() in SUFFIXES)
    if len(videos) < 3:
        sys.exit(f"{clips} holds {len(videos)} clips; give a folder with at least three")
    folder.mkdir(parents=True, exist_ok=True)
    learned, left_out = videos[:-1], videos[-1]
    texts = (
        {path.stem: sentence(path.stem) for path in videos} if not (clips / "lines.csv").is_file() else _read(clips / "lines.csv")
    )
    lines, actor, model = folder / "lines.csv", folder / "actor", folder / "actor.safetensors"
    with lines.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([("id", "text"), *texts.items()])
    facesynth("corpus", "add", actor, *learned, "--text-file", lines)
    facesynth("corpus", "check", actor, may_fail=True)
    facesynth("corpus", "stats", actor, "--pictures", folder / "pictures")
    facesynth("train", "efase", actor, "-o", model)
    text = texts[left_out.stem]
    outputs = [part for name in ("said.mp4", "said.csv", "said.glb", "said.npz") for part in ("-o", folder / name)]
    facesynth("speak", model, left_out, "--text", text, "--fps", 25, "--size", "640x640", *outputs)
    beside, plate = side_by_side(left_out, folder / "said.mp4", folder / "said.npz", actor, folder)
    print(f"{beside}: the real clip beside the head; {plate}: pictures of both, and how far their lips are open")
    print(f"{left_out.name} says “{text}”; so does {folder / 'said.mp4'}, on the built-in head, without having learned from it")


def facesynth(*arguments: object, may_fail: bool = False) -> None:
    """Run one command as a person would, and show it."""
    words = [str(argument) for argument in arguments]
    shown = words if len(words) < 12 else [*words[:4], "…", *words[-2:]]
    print("$ facesynth", shlex.join(shown), flush=True)
    code = subprocess.call([sys.executable, "-c", "from facesynth.cli import main; main()", *words])
    if code and not may_fail:
        sys.exit(code)


def _read(path: Path) -> dict[str, str]:
    with path.open(encoding="utf-8-sig", newline="") as file:
        return {Path(row["id"]).stem: row["text"] for row in csv.DictReader(file)}


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python examples/walk.py CLIPS FOLDER")
    main(Path(sys.argv[1]), Path(sys.argv[2]))
