"""How quick the map of a phone is, and how true beside scikit-learn's Isomap.

    python benchmarks/isomap.py MODEL [--phone ay] [--frames 6000]

The frames are those of a trained model's nodes: of one phone, evenly, and of as many phones after it as are needed to have so
many. Both embed the same frames with 12 neighbours. The residual variance, 1 - R² between distances along the cloud and in the
plane, is computed from scikit-learn's matrix of all shortest ways for both. New frames: the map is made of every other frame,
and the rest is placed into it. Seconds of the processor on one thread.
"""

import argparse
import time
import warnings

import numpy as np
from sklearn.manifold import Isomap as ScikitIsomap
from threadpoolctl import threadpool_limits

from facesynth.methods.registry import load
from facesynth.motion.maps.isomap import NEIGHBOURS, Isomap, evenly, residual_variance


def frames_of(model, phone, count):
    phones = model.mapped_phones()
    after = phones[phones.index(phone) :] + phones[: phones.index(phone)]
    found = np.zeros((0, 0))
    for number, one in enumerate(after, 1):
        own = model.phone_map(one, "pca").cluster.frames
        found = own if number == 1 else np.concatenate([found, own])
        if len(found) >= count:
            break
    print(f"{min(len(found), count)} of {len(found)} frames of {' '.join(after[:number])}, {found.shape[1]} coordinates")
    return found[evenly(len(found), count)]


def timed(what, repeats=3):
    times = []
    for _ in range(repeats):
        start = time.process_time()
        result = what()
        times.append(time.process_time() - start)
    return min(times), result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("--phone", default="ay")
    parser.add_argument("--frames", type=int, default=6000)
    options = parser.parse_args()
    cloud = frames_of(load(options.model), options.phone, options.frames)
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # scikit-learn tells of parts that it ties together, as ours does
        ours_s, ours = timed(lambda: Isomap.fit(cloud).place(cloud))
        theirs_s, theirs = timed(lambda: ScikitIsomap(n_neighbors=NEIGHBOURS).fit(cloud), 1)
        ways = theirs.dist_matrix_
        rows = {"ours": (ours_s, ours), "scikit-learn": (theirs_s, theirs.embedding_)}
        half_s, placed = timed(lambda: Isomap.fit(cloud[::2]).place(cloud))
        rows["ours, half of the frames placed into it"] = (half_s, placed)
        rows["two principal components"] = timed(lambda: principal(cloud))
        for name, (seconds, places) in rows.items():
            print(f"  {name}: {seconds:.2f} s, residual variance {residual_variance(ways, places):.4f}", flush=True)


def principal(cloud):
    centred = cloud - cloud.mean(axis=0)
    return centred @ np.linalg.eigh(centred.T @ centred)[1][:, ::-1][:, :2]


if __name__ == "__main__":
    main()
