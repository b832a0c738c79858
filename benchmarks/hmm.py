"""Our hidden Markov models with an exit beside hmmlearn's, which have none: python benchmarks/hmm.py (pip install hmmlearn)

Short segments, as prosody of a movement of the head: drawn from three states that follow each other, learned from by both with
the same numbers of states and mixtures, judged by the log likelihood a frame of other segments. Processor time in the same run.
"""

import time

import numpy as np
from hmmlearn.hmm import GMMHMM

from facesynth.methods.head_hmm.baum_welch import begun, learn, log_likelihood

STATES, MIXTURES, WIDTH, ROUNDS = 3, 2, 4, 10


def segments(count: int, seed: int) -> list[np.ndarray]:
    """Sequences [T, 4] of 4 to 20 frames."""
    rng = np.random.default_rng(seed)
    middles = np.random.default_rng(7).normal(0, 1.5, (STATES, WIDTH))
    lengths = rng.integers(4, 21, count)
    return [middles[np.arange(n) * STATES // n] + rng.normal(0, 1, (n, WIDTH)) for n in lengths]


def main() -> None:
    known, others = segments(400, 0), segments(200, 1)
    frames = sum(map(len, others))
    begin = time.process_time()
    ours, _ = learn(begun(known, STATES, MIXTURES, all_follow=False), known, ROUNDS)
    spent = time.process_time() - begin
    print(f"ours, with an exit: {spent:.2f} s, {log_likelihood(ours, others) / frames:.3f} a frame, the exit included")
    begin = time.process_time()
    theirs = GMMHMM(STATES, MIXTURES, covariance_type="diag", n_iter=ROUNDS, random_state=0, min_covar=0.02)
    theirs.fit(np.concatenate(known), [len(one) for one in known])
    spent = time.process_time() - begin
    found = theirs.score(np.concatenate(others), [len(one) for one in others])
    print(f"hmmlearn: {spent:.2f} s, {found / frames:.3f} a frame, with no end to a segment")


if __name__ == "__main__":
    main()
