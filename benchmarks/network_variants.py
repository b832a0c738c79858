"""What makes the network of poses better on clips that it never saw: one change at a time, and some together.

python benchmarks/network_variants.py CORPUS -o FOLDER [--fold 1] [--device cuda] [--steps 350] [--variants both bands …]

Of the clips that a fold learns from a fifth is kept out; the rest is learned from, and the lip error of the clips kept out says
which variant is best. The tested clips play no part. Each network stays in FOLDER, and is not learned again.
OMP_NUM_THREADS says how many threads learn.
"""

import argparse
import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter, process_time
from unittest.mock import patch

import numpy as np

from facesynth.corpus import Corpus
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve
from facesynth.inference.errors import FacesynthError
from facesynth.methods.learn import expectation, point_loss, windows
from facesynth.methods.learn.hearing import Hearing
from facesynth.methods.learn.pose_network import PoseNetwork
from facesynth.methods.network.method import Network
from facesynth.methods.registry import load

FOLDS, HELD_OUT = 5, 0.2
ROOMS = {"point_loss": point_loss, "windows": windows, "expectation": expectation}


@dataclass(frozen=True)
class Variant:
    """How a network is trained."""

    settings: Mapping[str, object] = field(default_factory=dict)
    """Of the method."""
    constants: Mapping[str, float] = field(default_factory=dict)
    """`room.NAME` of facesynth.methods.learn that are something else."""
    shape: Mapping[str, float] = field(default_factory=dict)
    """Of the network: width, dropout."""

    def __or__(self, other: "Variant") -> "Variant":
        return Variant(*({**getattr(self, name), **getattr(other, name)} for name in ("settings", "constants", "shape")))


BANDS = Variant({"features": "log_mel"})
SETTLED = BANDS | Variant(constants={"expectation.AVERAGED": 0.995})
DROPPED = BANDS | Variant({"steps": 1000}, shape={"dropout": 0.35})
VARIANTS = {
    "both": Variant(),
    "bands": BANDS,
    "phone_net": Variant({"features": "phone_net"}),
    "lips": BANDS | Variant(constants={"point_loss.LIPS": 12.0}),
    "noisy": BANDS | Variant(constants={"windows.NOISE": 0.3, "windows.LOUDNESS": 0.3, "windows.MASK_SHARE": 0.9}),
    "tempo": BANDS | Variant(constants={"windows.TEMPO": 0.25}),
    "dropped": DROPPED,
    "longer": BANDS | Variant({"steps": 1400}),
    "settled": SETTLED,
    "dropped, settled": DROPPED | SETTLED,
}
LOOK_AHEAD_MS = (0, 40, 80, 160, 320)
VARIANTS |= {f"{ms} ms": Variant({"look_ahead_s": ms / 1000}) for ms in LOOK_AHEAD_MS}
FEATURES = ("log_mel", "phone_net", "both")
BY_EAR = {features: Variant({"features": features, "phones": False}) for features in FEATURES}
"""Networks that hear sound alone."""
for heard, alone in BY_EAR.items():
    VARIANTS |= {f"sound, {heard}": alone}
    VARIANTS |= {f"sound, {heard} {ms} ms": alone | Variant({"look_ahead_s": ms / 1000}) for ms in LOOK_AHEAD_MS}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--fold", type=int, default=1)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, help="of the training, for all variants; their own unless given")
    parser.add_argument("--variants", nargs="+", default=list(VARIANTS), metavar="NAME")
    options = parser.parse_args()
    rest, _ = parts(Corpus.open(options.corpus), options.fold)
    learned, held_out = inner(rest, options.fold)
    print(f"fold {options.fold}: {len(learned)} clips to learn from, {len(held_out)} to choose by", flush=True)
    shorter = Variant({"steps": options.steps} if options.steps else {})
    for name in options.variants:
        began = perf_counter()
        path = options.output / file_of(name, options.fold, options.steps, options.seed)
        network = kept(path, learned, VARIANTS[name] | shorter, options.seed, options.device)
        lips, energy = judged(network, held_out)
        found = {"fold": options.fold, "variant": name, "steps": options.steps, "lve": lips, "energy": energy}
        path.with_suffix(".json").write_text(json.dumps(found))
        print(f"| {options.fold} | {name} | {lips:.3f} | {energy:.2f} | {perf_counter() - began:.0f} s |", flush=True)


def file_of(variant: str, fold: int, steps: int | None, seed: int) -> str:
    """What a network's file is called."""
    return f"{fold}_{variant.replace(' ', '_')}" + (f"_{steps}steps" if steps else "") + f"_{seed}.safetensors"


def parts(corpus: Corpus, fold: int) -> tuple[Corpus, Corpus]:
    """(to learn from, tested) of a fold, 1 to FOLDS."""
    return list(corpus.folds(FOLDS, 0))[fold - 1]


def fewer(rest: Corpus, fold: int, count: int) -> tuple[Corpus, Corpus]:
    """(so many clips to learn from, those that are left over) at random; a smaller number's are among a larger one's."""
    if not 1 <= count <= len(rest):
        raise FacesynthError(f"{count} clips are wanted to learn from; fold {fold} has 1 to {len(rest)}")
    order = [rest.ids[i] for i in np.random.default_rng(fold).permutation(len(rest.ids))]
    return rest.subset(order[:count]), rest.subset(order[count:])


def inner(rest: Corpus, fold: int) -> tuple[Corpus, Corpus]:
    """(to learn from, to choose by) of what a fold learns from."""
    order = np.random.default_rng(4 + fold).permutation(len(rest.ids))
    count = round(HELD_OUT * len(order))
    return rest.subset([rest.ids[i] for i in order[count:]]), rest.subset([rest.ids[i] for i in order[:count]])


def judged(network: Network, corpus: Corpus) -> tuple[float, float]:
    """Mean lip error, mm, and energy."""
    made = [(network.synthesize(u.speech), u.motion) for u in corpus]
    return float(np.mean([lve(*pair) for pair in made])), float(np.mean([energy_ratio(*pair) for pair in made]))


def kept(path: Path, corpus: Corpus, variant: Variant, seed: int, device: str) -> Network:
    """The network of a file, or a new one that is written there."""
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        began = process_time()
        trained(corpus, variant, seed, device).save(path)
        print(f"{path.stem}: {len(corpus)} clips learned from in {process_time() - began:.0f} s of processor time", flush=True)
    found = load(path)
    assert isinstance(found, Network)
    return found


def trained(corpus: Corpus, variant: Variant, seed: int, device: str) -> Network:
    """A network on the processor that learned on a device."""
    with changed(variant):
        return Network(**variant.settings).to(device).fit(corpus, seed=seed).to("cpu")  # type: ignore[arg-type]


OF_SOUND = Hearing.of_sound


def of_sound(hearing: Hearing, audio: np.ndarray, heard: dict[object, np.ndarray] = {}) -> np.ndarray:  # noqa: B006
    """What is heard of a sound, remembered."""
    key = hearing.features, hearing.width, hashlib.sha256(audio.tobytes()).digest()
    if key not in heard:
        heard[key] = OF_SOUND(hearing, audio)
    return heard[key]


@contextmanager
def changed(variant: Variant) -> Iterator[None]:
    """The trainer with a variant's constants and shape."""
    patches = [patch.object(ROOMS[name.split(".")[0]], name.split(".")[1], value) for name, value in variant.constants.items()]
    patches.append(patch.object(expectation, "PoseNetwork", partial(PoseNetwork, **variant.shape)))
    patches.append(patch.object(Hearing, "of_sound", of_sound))
    for each in patches:
        each.start()
    try:
        yield
    finally:
        for each in reversed(patches):
            each.stop()


if __name__ == "__main__":
    main()
