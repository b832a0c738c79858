"""Key poses against least squares on the built-in head, where the answer is known: weights → markers → weights.

python benchmarks/key_poses.py corpus/     (recordings of the built-in performer)

Weights are solved from every second utterance, posed, and learned from as many frames as are worth posing; the other
utterances are unseen. Least squares knows the shapes of the head, key poses do not.
"""

import sys
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.corpus import Corpus
from facesynth.face.rig.arkit_rig import load_head, pose_points
from facesynth.face.rig.markers import marker_layout, marker_vertices
from facesynth.face.solve.blendshapes import MarkerBasis, solve_markers
from facesynth.face.solve.key_poses import KeyPoseMap, KeyPoses, worth_posing

EVERY = 4
"""Of the frames; neighbours are nearly the same pose."""
UTTERANCES = 24
HAND = 0.1
"""Standard deviation of the weights of somebody who poses by hand, of those that are not 0."""


def main(path: Path) -> None:
    rig = load_head()
    layout, corpus = marker_layout(rig), Corpus.open(path)
    vertices, basis, rest = marker_vertices(rig, layout), MarkerBasis.of(rig, layout), layout.neutral
    motions = [corpus[name].motion for name in corpus.ids[:UTTERANCES]]
    solved = [solve_markers(basis, motion.frames[::EVERY], motion.fps / EVERY)[0] for motion in motions]
    recorded, unseen = np.concatenate(solved[::2]), np.concatenate(solved[1::2])

    def markers(weights: NDArray[np.float64]) -> NDArray[np.float64]:
        return pose_points(rig, vertices, weights).reshape(len(weights), -1).astype(np.float64)

    def line(name: str, weights: NDArray[np.float64]) -> None:
        off = np.linalg.norm((markers(weights) - wanted).reshape(len(wanted), -1, 3), axis=2)[:, layout.group("mouth")]
        print(f"{name:34s} {off.mean():6.2f} mm {np.sqrt(np.square(weights - unseen).mean()):8.3f}")

    frames, wanted = markers(recorded), markers(unseen)
    print(f"{len(unseen)} unseen frames: error at the mouth, root mean square error of the weights")
    line("rest", 0 * unseen)
    rng = np.random.default_rng(0)
    for count in (5, 10, 15, 20, 40, 80):
        chosen = worth_posing(frames, rest, count)
        exact = recorded[chosen]
        by_hand = np.clip(exact + rng.normal(0, HAND, exact.shape) * (exact > 0), 0, 1)
        for name, weights in ((f"{count} key poses", exact), (f"{count} key poses, by an unsure hand", by_hand)):
            found = KeyPoseMap.fit(KeyPoses(layout, rig.names, frames[chosen], weights), rest, frames)
            line(name, found(torch.from_numpy(wanted)).numpy())
    line("least squares on the known shapes", solve_markers(basis, wanted, motions[0].fps / EVERY)[0])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
