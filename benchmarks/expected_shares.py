"""Two that err in different places, and their mean: the network and the regression beside it, the search and what it expects.

python benchmarks/expected_shares.py CORPUS -o FOLDER [--fold 1] [--join]

On the clips that a fold of `frontier.py` chooses by and on those that it tests, for several shares: lip error (mm) and energy,
as it comes and sharpened until lips move as recorded (on the clips that choose). FOLDER keeps networks and figures.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch
from frontier import lively, soft_efase
from frontier_table import Motions
from network_variants import VARIANTS, inner, kept, parts

from facesynth.corpus import Corpus
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve
from facesynth.methods.efase.method import Efase
from facesynth.methods.learn.linear_path import LinearPath
from facesynth.methods.learn.point_loss import lip_points
from facesynth.methods.learn.sharpening import matching_share
from facesynth.methods.network.method import Network

OF_REGRESSION = np.linspace(0, 1, 11)
OF_EXPECTED = np.linspace(0, 1, 5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--fold", type=int, help="1 to 5; all unless given")
    parser.add_argument("--device", default="cpu", help="where networks learn")
    parser.add_argument("--join", action="store_true", help="only print the tables of what is there")
    options = parser.parse_args()
    torch.set_num_threads(1)
    for fold in [] if options.join else [options.fold] if options.fold else range(1, 6):
        one_fold(Corpus.open(options.corpus), fold, options)
    join(options.output)


def one_fold(corpus: Corpus, fold: int, options: argparse.Namespace) -> None:
    """Figures of all shares for both kinds of clips, kept in the folder."""
    rest, tested = parts(corpus, fold)
    learned, held_out = inner(rest, fold)
    found: dict[str, list[list[float]]] = {}
    raised: dict[str, float] = {}
    for kind, name, own, some in (("choosing", "0", learned, held_out), ("tested", "whole", rest, tested)):
        network = kept(options.output / f"{fold}_both_{name}.safetensors", own, VARIANTS["both"], 0, options.device)
        for what, ways in {
            "regression": of_regression(network, some),
            "expected": of_expected(soft_efase(network, own), some),
        }.items():
            for share, motions in ways:
                if kind == "choosing":
                    raised[f"{what}_{share:g}"] = matching_share(
                        [(motions[u.id], u.motion) for u in some], lip_points(corpus.layout)
                    )
                figures = near(motions, some) + near(lively(motions, some, raised[f"{what}_{share:g}"]), some)
                found.setdefault(f"{kind}_{what}", []).append(figures)
                print(fold, kind, what, share, np.round(figures, 3), flush=True)
    np.savez(options.output / f"shares_{fold}.npz", **found)


def of_regression(network: Network, some: Corpus) -> Iterator[tuple[float, Motions]]:
    """Each share of the regression, and the motions with it: frames are linear in it."""
    ends = []
    for share in (0.0, 1.0):
        with patch.object(LinearPath, "share", share):
            ends.append({u.id: network.synthesize(u.speech) for u in some})
    for share in OF_REGRESSION:
        yield (
            float(share),
            {
                name: replace(one, frames=one.frames + np.float32(share) * (ends[1][name].frames - one.frames))
                for name, one in ends[0].items()
            },
        )


def of_expected(model: Efase, some: Corpus) -> Iterator[tuple[float, Motions]]:
    """Each share of the expected pose, and the motions with it, of one search."""
    speaker = model.speaker
    plans = {u.id: speaker.plans(u.speech) for u in some}
    for share in OF_EXPECTED:
        speaker.settings = replace(speaker.settings, expected_share=float(share))
        yield float(share), {u.id: speaker.moved(u.speech, plans[u.id]) for u in some}


def near(motions: Motions, some: Corpus) -> list[float]:
    """Mean lip error and energy."""
    return [float(np.mean([rate(motions[u.id], u.motion) for u in some])) for rate in (lve, energy_ratio)]


def join(folder: Path) -> None:
    """Means over the folds that are there, and what each fold would have chosen."""
    folds = [dict(np.load(path)) for path in sorted(folder.glob("shares_*.npz"))]
    for what, shares in {"regression": OF_REGRESSION, "expected": OF_EXPECTED}.items() if folds else ():
        choosing, tested = (np.array([fold[f"{kind}_{what}"] for fold in folds]) for kind in ("choosing", "tested"))
        print(f"\n| share of the {what} | choosing: lip error | sharpened | tested: lip error | sharpened |")
        print("|---:|---:|---:|---:|---:|")
        for share, own, other in zip(shares, choosing.mean(axis=0), tested.mean(axis=0), strict=True):
            print(
                f"| {share:g} | " + " | ".join(f"{row[k]:.3f} ({row[k + 1]:.2f})" for row in (own, other) for k in (0, 2)) + " |"
            )
        for k, how in ((0, "as it comes"), (2, "sharpened")):
            best = choosing[:, :, k].argmin(axis=1)
            chosen = tested[np.arange(len(folds)), best, k].mean()
            print(f"each fold's own choice, {how} ({', '.join(f'{shares[b]:g}' for b in best)}): {chosen:.3f}")


if __name__ == "__main__":
    main()
