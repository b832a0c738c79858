"""Calibrate how far the built-in performer's mouth opens at each phone on a recorded talker.

python train/performer_targets.py CORPUS TABLE -o targets.csv

CORPUS shows the lips of a talker, such as GRID s1; TABLE is the table of targets to start from (facesynth/performer/targets.csv).
Only statistics of the recordings enter: one opening and one dominance for each phone, how early and how late phones of a viseme
class are felt, and how the openings rise and fade for all. Every fourth recording is left out and judged. Rows of phones that
were not recorded follow their viseme class. Recorded openings are evened out first: small ones of that talker are more than other
people's (`inference.openings`), and the performer is to be like others, too.
"""

import argparse
import csv
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus, Utterance
from facesynth.device import device_of
from facesynth.evaluation.lips import lip_opening
from facesynth.face.rig.arkit_rig import load_head
from facesynth.face.rig.markers import MIDDLE_LIPS, LipGap
from facesynth.inference.lips import bilabial_spans, narrowest_gaps
from facesynth.inference.openings import Openings
from facesynth.inference.phones import SILENCE, VISEME_CLASSES, VOWELS
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.performer.articulation import FADE, contacts, gestures_of, heard_loudness
from facesynth.performer.cues import listen
from facesynth.performer.emotion import sides
from facesynth.performer.targets import CURVES, SHAPES, Target, read_targets

FPS = 100.0
EPOCHS, BATCH, RATE = 14, 30, 0.06
DRAWN_CLASS, DRAWN_PHONE = (0.02, 0.002), (0.08, 0.008)
"""How strongly factors of classes and of phones are drawn to 1, those of openings and of dominance: 51 words say little of how
far a mouth opens at each phone of a language, more of which phones prevail."""
DRAWN_TIME, DRAWN_ERROR = 0.004, 0.02
"""The same of how long a class is felt; what an error in mm² costs beside 1 - correlation."""
EVENED = 0.6
"""Exponent of a recorded opening between shut and wide."""
WIDE_PERCENTILE = 95
"""Of recorded openings: what counts as wide open."""
LIPS_MOST = 0.6
"""Share of an opening that the lips make at most; the rest is the jaw's."""
LEAST_MM, MOST_MM, JAW_MOST = 0.2, 16.0, 0.55
SIBILANTS = frozenset(["s", "z", "sh", "zh", "ch", "jh"])
"""Their teeth stay together, however far the lips part: the jaw's target and dominance are not changed."""
LIKE = {"ae": "eh", "en": "n", "el": "l"}
"""Phones that follow another: GRID says `ae` in the unstressed word `at` alone, and never the syllables."""


@dataclass(frozen=True)
class Clip:
    """Gestures [G] of a recording and the opening [T] that was seen, mm, from the first to the last phone."""

    phone: Tensor
    start_s: Tensor
    end_s: Tensor
    loudness: Tensor
    shut: Tensor
    seen_mm: Tensor
    spoken: slice


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("table", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--limit", type=int, default=120)
    parser.add_argument("--rounded", type=float, default=1.0, help="share of rounding and spreading that is kept")
    parser.add_argument("--wider", type=float, default=1.0, help="factor of the openings: 1 is as the talker")
    parser.add_argument("--device", default="auto", help="auto, cpu, cuda or mps")
    options = parser.parse_args()
    corpus, table = Corpus.open(options.corpus), read_targets(options.table.read_text(encoding="utf-8"))
    with device_of(options.device):
        said = [corpus[name] for name in corpus.ids[: options.limit]]
        openings = openings_of(said)
        clips = [clip_of(utterance, list(table), openings) for utterance in said]
        clips = [clip for clip in clips if torch.isfinite(clip.seen_mm).all()]
        fit = Fit(table)
        print(f"correlation of openings in {len(clips[::4])} recordings that are left out: {fit.judged(clips[::4]):.3f}")
        fit.learn([clip for number, clip in enumerate(clips) if number % 4])
        print(f"after calibration: {fit.judged(clips[::4]):.3f}")
    print({name: round(value, 4) for name, value in fit.constants().items()})
    write(options.table, options.output, fit, options.rounded, options.wider)


def openings_of(said: list[Utterance]) -> Openings:
    """How a talker's openings are evened out: from his p, b and m to what one frame in twenty exceeds."""
    shut = [
        narrowest
        for u in said
        for narrowest in narrowest_gaps(u.motion.frames, u.motion.layout, bilabial_spans(u.speech.phones, u.motion.fps))
    ]
    wide = np.nanpercentile(np.concatenate([lip_opening(u.motion) for u in said]), WIDE_PERCENTILE)
    return Openings(EVENED, float(np.nanmedian(shut)), float(wide))


def clip_of(utterance: Utterance, phones: list[str], openings: Openings) -> Clip:
    speech = utterance.speech
    count = int(speech.phones.frame_bounds(FPS)[-1])
    times = np.arange(count) / FPS
    cues = listen(speech, np.zeros(1), count, FPS)
    gestures = gestures_of(speech.phones)
    seen = openings.changed(lip_opening(utterance.motion))
    bounds = speech.phones.frame_bounds(FPS)
    spoken = [k for k, label in enumerate(speech.phones.labels) if label != SILENCE]
    return Clip(
        torch.tensor([phones.index(one.target.phone) for one in gestures]),
        _tensor([one.start_s for one in gestures]),
        _tensor([one.end_s for one in gestures]),
        _tensor([heard_loudness(one, times, cues.loudness) for one in gestures]),
        _tensor(contacts(gestures, times)[0]),
        _tensor(np.interp(times, np.arange(len(seen)) / utterance.motion.fps, seen)),
        slice(int(bounds[spoken[0]]), int(bounds[spoken[-1] + 1])),
    )


class Fit(torch.nn.Module):
    """The performer's blend of openings (articulation.py), differentiable, with factors of what is calibrated."""

    def __init__(self, table: dict[str, Target]) -> None:
        super().__init__()
        self.phones, count = list(table), len(VISEME_CLASSES)
        slopes = lip_slopes_mm()
        self.start_mm = _tensor([max(float(one.pose @ slopes), LEAST_MM) for one in table.values()])
        self.claim = _tensor([one.dominance[CURVES.index("jaw_open")] for one in table.values()])
        self.early, self.late = (_tensor([getattr(one, name) for one in table.values()]) for name in ("early", "late"))
        self.vowel = torch.tensor([phone in VOWELS for phone in self.phones])
        self.kind = torch.tensor([next(k for k, one in enumerate(VISEME_CLASSES) if phone in one) for phone in self.phones])
        self.of_class, self.of_phone = (torch.nn.Parameter(torch.zeros(2, n)) for n in (count, len(self.phones)))
        self.felt = torch.nn.Parameter(torch.zeros(2, count))
        self.shared = torch.nn.Parameter(torch.zeros(len(FADE)))
        self.line = torch.nn.Parameter(torch.tensor([0.0, 1.0]))

    def factors(self) -> Tensor:
        """[2, P] of openings and of dominance."""
        return torch.exp(self.of_class[:, self.kind] + self.of_phone)

    def times(self) -> Tensor:
        """[2, P] factors of how early and how late each phone is felt."""
        return torch.exp(self.felt[:, self.kind])

    def constants(self) -> dict[str, float]:
        """What the constants of `FADE` are to be."""
        return {
            name: value * float(torch.exp(factor))
            for (name, value), factor in zip(FADE.items(), self.shared.detach(), strict=True)
        }

    def forward(self, clip: Clip) -> Tensor:
        """[T] opening, mm."""
        fade = {name: value * torch.exp(factor) for (name, value), factor in zip(FADE.items(), self.shared, strict=True)}
        opening, dominance = (row[clip.phone] for row in self.factors())
        length = clip.end_s - clip.start_s
        middle, short = (clip.start_s + clip.end_s) / 2, length.clamp(max=0.16)
        reached = (length / 0.1).clamp(min=0.02) ** fade["long"]
        reached = reached.clamp(0.4, 1.25) * clip.loudness ** fade["loud"]
        target = self.start_mm[clip.phone] * opening * torch.where(self.vowel[clip.phone], reached, 1.0)
        times = torch.arange(len(clip.seen_mm))[:, None] / FPS
        away = ((times - middle).abs() - fade["held"] * length).clamp(min=0)
        earlier, later = (row[clip.phone] for row in self.times())
        before = earlier * self.early[clip.phone] * (fade["before_s"] + fade["before"] * short)
        after = later * self.late[clip.phone] * (fade["after_s"] + fade["after"] * short)
        felt = torch.exp(-((away / torch.where(times < middle, before, after) + 1e-6) ** 1.25))
        weights = self.claim[clip.phone] * dominance * felt
        blend = (weights * target).sum(dim=1) / (weights.sum(dim=1) + 1e-6)
        return self._smooth(blend, fade["smooth_s"] * FPS) * (1 - clip.shut)

    def _smooth(self, curve: Tensor, deviation: Tensor) -> Tensor:
        kernel = torch.exp(-0.5 * (torch.arange(-6, 7) / deviation) ** 2)
        padded = torch.nn.functional.pad(curve[None, None], (6, 6), mode="replicate")
        return torch.nn.functional.conv1d(padded, (kernel / kernel.sum())[None, None])[0, 0]

    def learn(self, clips: list[Clip]) -> None:
        """Descend."""
        optimiser, rng = torch.optim.Adam(self.parameters(), RATE), np.random.default_rng(0)
        for _ in range(EPOCHS):
            order = rng.permutation(len(clips))
            for first, last in pairwise([*range(0, len(order), BATCH), len(order)]):
                loss = torch.stack([self.loss(clips[k]) for k in order[first:last]]).mean() + self.drawn()
                optimiser.zero_grad()
                loss.backward()  # type: ignore[no-untyped-call]  # torch leaves it untyped
                optimiser.step()

    def loss(self, clip: Clip) -> Tensor:
        """How unlike the opening that was seen is, in course and size."""
        made, seen = self(clip)[clip.spoken], clip.seen_mm[clip.spoken]
        off = self.line[0] + self.line[1] * made - seen
        return 1 - correlation(made, seen) + DRAWN_ERROR * off.square().mean()

    def drawn(self) -> Tensor:
        """What factors cost that are not 1."""
        by_class, by_phone = (factors.square().sum(dim=1) for factors in (self.of_class, self.of_phone))
        return _tensor(DRAWN_CLASS) @ by_class + _tensor(DRAWN_PHONE) @ by_phone + DRAWN_TIME * self.felt.square().sum()

    @torch.no_grad()
    def judged(self, clips: list[Clip]) -> float:
        """Mean correlation with the openings that were seen."""
        return float(np.mean([float(correlation(self(clip)[clip.spoken], clip.seen_mm[clip.spoken])) for clip in clips]))


def correlation(mine: Tensor, yours: Tensor) -> Tensor:
    mine, yours = mine - mine.mean(), yours - yours.mean()
    return (mine * yours).sum() / (mine.norm() * yours.norm() + 1e-9)


def lip_slopes_mm() -> np.ndarray:
    """[14] opening of the lips, mm, of each of the performer's curves."""
    slopes = LipGap.of(load_head()).slopes_mm[MIDDLE_LIPS].mean(axis=0)
    names = [sides(SHAPES[curve], 0.0) if curve in SHAPES else {} for curve in CURVES]
    return np.array([sum(share * slopes[ARKIT_NAMES.index(name)] for name, share in one.items()) for one in names])


def calibrated(target: Target, opening_mm: float, dominance: float, rounded: float) -> Target:
    """A target that opens so far: by the lips up to LIPS_MOST of it, by the jaw for the rest, but at sibilants."""
    slopes, pose = lip_slopes_mm(), target.pose.copy()
    jaw, lips = CURVES.index("jaw_open"), [CURVES.index(name) for name in ("lower_down", "upper_up")]
    pose[[CURVES.index(name) for name in ("pucker", "funnel", "stretch", "smile")]] *= rounded
    by_lips = float(pose[lips] @ slopes[lips])
    pose[lips] *= min(1.0, LIPS_MOST * opening_mm / by_lips) if by_lips > 0 else 1.0
    others = float(pose @ slopes) - pose[jaw] * slopes[jaw]
    claims = target.dominance.copy()
    claims[lips] *= dominance
    if target.phone not in SIBILANTS:
        pose[jaw] = np.clip((opening_mm - others) / slopes[jaw], 0.01, JAW_MOST)
        claims[jaw] *= dominance
    return replace(target, pose=pose, dominance=claims)


def write(table: Path, output: Path, fit: Fit, rounded: float, wider: float) -> None:
    """The table with the openings and dominances of a fit; contacts and rests stay as they are."""
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    known = read_targets(table.read_text(encoding="utf-8"))
    opening, dominance = fit.factors().detach().cpu().numpy()
    early, late = fit.times().detach().cpu().numpy()
    for number, row in enumerate(rows):
        if row["closes"] in ("lips", "rest"):
            continue
        like = fit.phones.index(LIKE.get(row["phone"], row["phone"]))
        opening_mm = min(float(wider * fit.start_mm[number] * opening[like]), MOST_MM)
        made = calibrated(known[row["phone"]], opening_mm, float(dominance[like]), rounded)
        row |= {name: f"{value:.3g}" for name, value in zip(CURVES, made.pose, strict=True)}
        for who, name in (("jaw", "jaw_open"), ("opening", "lower_down")):
            row[f"{who}_dominance"] = f"{made.dominance[CURVES.index(name)]:.3g}"
        row |= {"early": f"{made.early * early[like]:.3g}", "late": f"{made.late * late[like]:.3g}"}
    with output.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _tensor(values: object) -> Tensor:
    return torch.as_tensor(np.asarray(values), dtype=torch.float32)


if __name__ == "__main__":
    main()
