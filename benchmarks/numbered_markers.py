"""How well groups of markers are told by how they move, where their names say nothing: `numbered_markers.py CORPUS`.

The corpus must have groups of its own, such as the built-in performer's: its markers are numbered, the head's motion is
put back, and what is told from twelve recordings at a time is compared with the corpus' groups.
"""

import sys

import numpy as np

from facesynth.corpus import Corpus
from facesynth.motion.point_groups import guess_groups
from facesynth.motion.pose import apply_head, rigid_points

RECORDINGS, FRAMES = 12, 60


def main(path: str) -> None:
    """Print hits and strangers of each group."""
    corpus = Corpus.open(path)
    layout = corpus.layout
    for first in range(0, len(corpus) - RECORDINGS, max(len(corpus) // 4, 1)):
        parts = [world(corpus, name) for name in corpus.ids[first : first + RECORDINGS]]
        guess = guess_groups([f"*{number}" for number in range(len(layout.names))], np.concatenate(parts))
        pairs = len(set(guess.lip_pairs) & set(layout.lip_pairs))
        print(f"recordings from {first}: {pairs} of {len(layout.lip_pairs)} pairs of the lips, {len(guess.lip_pairs)} told")
        for name, members in guess.groups.items():
            true = set(layout.groups.get(name, ()))
            print(f"  {name:10} {len(true & set(members))} of {len(true)} found, {len(set(members) - true)} others among them")


def world(corpus: Corpus, name: str) -> np.ndarray:
    """[N, K, 3] some frames of a recording as a capture system sees them, the head's motion in them."""
    motion, layout = corpus.raw_motion(name), corpus.layout
    points = apply_head(motion.points, motion.head, np.reshape(layout.neutral, (-1, 3)), rigid_points(layout))
    return points[:: max(1, len(points) // FRAMES)].astype(np.float64)


if __name__ == "__main__":
    main(sys.argv[1])
