"""Ways to move eyes beside recorded eyes: Kolmogorov-Smirnov distances, one person (or half of the recordings) left out.

python benchmarks/eyes.py DATA CORPUS [--write eyes.safetensors] [--picture head_and_eyes.png]

DATA holds the folders gaze_conversation (fixations of people in conversation) and head_conversation (heads and eyes of two
people); CORPUS shows the lids of a talker, such as GRID s1 from video. --write keeps the model that comes with the package:
gaze of gaze_conversation with lids that are grown from CORPUS. --picture draws it beside recorded eyes.
"""

import argparse
import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from facesynth.corpus import Corpus
from facesynth.corpus.eyes import recorded_eyes
from facesynth.evaluation.eyes import (
    averaged,
    blink_statistics,
    distances,
    fixation_statistics,
    gaze_statistics,
    pooled,
)
from facesynth.face.behaviour.eyes import quiet_eyes
from facesynth.inference.eyes import at_rest
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.shift_patches import EITHER, LISTENING, SPEAKING
from facesynth.inference.speech import PhoneTrack
from facesynth.methods.baselines.random_eyes import random_eyes
from facesynth.methods.eyes.method import Eyes
from facesynth.methods.eyes.recordings import at_rate
from facesynth.motion.lids import Lids

LAYOUT = Layout("curves", ("jawOpen",))
PX_PER_DEG = 60.0
"""Of gaze_conversation, whose scale is not stated: a laptop's 1920 px on 31 cm, seen from 55 cm."""
FIXATION_HZ, FIXATION_FPS, LONGEST_GAP_S = 90.0, 30.0, 0.5
SHIFT_S = 0.06
"""A gaze takes no longer from place to place, however long the tracker saw none."""
HEAD_FPS, AVERAGED = 60.0, 7
"""Of head_conversation; its spectrum is zero at multiples of 60/7 Hz: it was averaged over 7 frames."""
COMPENSATION = 0.6
"""Share of the head's quick turns that is undone in one row."""
BLINKS = 26.0
"""A minute, of people in conversation (Bentivoglio et al. 1997, mean of 150); the talker who lends the lids blinks more often."""
MOST_S = 120.0
"""Of each person in each role the package's model learns from no more, so that nobody outweighs the others."""
GROWN_S = 120.0
FEWEST = 20
"""Fixations of a person who is compared with."""
ROLES = {"speaking": "speak", "listening": "listen"}
NUMBERS = {"speaking": SPEAKING, "listening": LISTENING}
People = dict[str, list[list[Motion]]]
"""Pieces of each person by role."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--write", type=Path)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    lids = [motion for motion, _ in recorded_eyes(corpus)]
    people = heads_and_eyes(options.data / "head_conversation")
    paths = sorted((options.data / "gaze_conversation").glob("*.csv"))
    seen = {role: [scanpaths(path, said) for path in paths] for role, said in ROLES.items()}
    packaged = as_packaged(seen, people, lids=lids)
    packaged.provenance = PROVENANCE
    if options.write:
        packaged.save(options.write)
        print(packaged.facts, options.write.stat().st_size, "bytes")
    if options.picture:
        draw(people[0], lids, packaged, options.picture)
    found = {f"gaze_conversation, {role}": fixation_rows(seen, role, people) for role in ROLES}
    found["head_conversation"] = gaze_rows(people, seen)
    for title, rows in found.items():
        table(f"{title}, one person left out", rows)
    table("mean distances, each person left out", over_all(found))
    table("blinks of the corpus, half of the recordings left out", blink_rows(lids))


def over_all(found: dict[str, dict[str, dict[str, float]]]) -> dict[str, dict[str, float]]:
    """Of each row that all tables have, the mean of each; speaking and listening together count as the other corpus does."""
    shared = [row for row in found["head_conversation"] if all(row in rows for rows in found.values())]
    means = {row: [float(np.mean(list(rows[row].values()))) for rows in found.values()] for row in shared}
    return {
        row: {"gaze_conversation": (speaking + listening) / 2, "head_conversation": beside_head}
        for row, (speaking, listening, beside_head) in means.items()
    }


def table(title: str, rows: dict[str, dict[str, float]]) -> None:
    names = list(next(iter(rows.values())))
    print(f"\n{title}\n\n| | {' | '.join(names)} | mean |\n| --- |{' ---: |' * (len(names) + 1)}")
    for row, values in rows.items():
        print(f"| {row} | {' | '.join(f'{values[name]:.2f}' for name in names)} | {np.mean(list(values.values())):.2f} |")


def heads_and_eyes(folder: Path) -> list[Motion]:
    """One motion a person. Signs are those with which eyes and head turn to the same side in wide shifts."""
    people = []
    for path in sorted(folder.glob("*.npz")):
        arrays = np.load(path)
        turns = Rotation.from_matrix(arrays["head_matrix_row_major"].astype(np.float64))
        head = np.pad((turns.mean().inv() * turns).as_rotvec(), ((0, 0), (0, 3)))
        up, left = signed(arrays)
        eyes = np.column_stack([np.ones(len(head)), left, up])
        people.append(Motion(np.zeros((len(head), 1)), HEAD_FPS, LAYOUT, head, eyes))
    return people


def signed(arrays) -> np.ndarray:
    """[2, T] gaze up and to the left, rad."""
    return np.radians(arrays["eyes_deg"].astype(np.float64)).T * np.array([[1.0], [-1.0]])


def scanpaths(path: Path, role: str) -> list[Motion]:
    """Fixations of a role as gaze: places that rest until a shift, a straight way, begins; a long pause begins a new piece."""
    rows = [row for row in csv.DictReader(path.open()) if row["role"] == role]
    start = np.array([float(row["Start"]) for row in rows]) / FIXATION_HZ
    stop = start + np.array([float(row["Length"]) - 1 for row in rows]) / FIXATION_HZ
    place = np.radians(np.array([[-float(row["Center_X"]), -float(row["Center_Y"])] for row in rows]) / PX_PER_DEG)
    place -= np.median(place, axis=0)
    ends = np.append(np.flatnonzero((start[1:] - stop[:-1] > LONGEST_GAP_S) | (np.diff(start) <= 0)) + 1, len(rows))
    pieces = []
    for first, last in zip(np.append(0, ends[:-1]), ends, strict=True):
        times = np.arange(start[first], stop[last - 1], 1 / FIXATION_FPS)
        if len(times) < FIXATION_FPS:
            continue
        leaves = np.append(np.maximum(stop[first : last - 1], start[first + 1 : last] - SHIFT_S), stop[last - 1])
        knots, ways = np.column_stack([start[first:last], leaves]).ravel(), np.repeat(place[first:last], 2, axis=0)
        gaze = np.stack([np.interp(times, knots, column) for column in ways.T], axis=1)
        eyes = np.column_stack([np.ones(len(times)), gaze])
        pieces.append(Motion(np.zeros((len(times), 1)), FIXATION_FPS, LAYOUT, None, eyes))
    return pieces


def in_one(pieces: list[Motion]) -> Motion:
    """The pieces of a person in one recording, with a gap after each."""
    eyes = np.concatenate([np.append(piece.eyes, np.full((1, 3), np.nan), axis=0) for piece in pieces])
    return Motion(np.zeros((len(eyes), 1)), pieces[0].fps, LAYOUT, None, eyes)


def learnt(motions: list[Motion], lids: list[Motion] | None = None, roles: list[int] | None = None, **config) -> Eyes:
    model = Eyes(**config)
    model.layout, model.emotions = LAYOUT, ("neutral",)
    model.learn(motions, "the recordings", roles=roles, lids=lids)
    return model.eval()


def as_packaged(seen: People, people: list[Motion], without: int | None = None, lids: list[Motion] | None = None) -> Eyes:
    """The model that comes with the package, or what it would be without one of those whose fixations were seen.

    Who speaks and who listens is known of those; where nobody knows it, eyes move as those of `people` beside their heads did.
    Everybody's gaze is brought to the spread of all in that role: people differ more in how far they look than in how.
    """
    motions, roles = [], []
    groups = {NUMBERS[role]: [most_of(one) for k, one in enumerate(all_) if k != without and one] for role, all_ in seen.items()}
    for role, some in {**groups, EITHER: [at_rate(one, FIXATION_FPS) for one in people]}.items():
        spreads = [np.nanstd(motion.eyes[:, 1:]) for motion in some]
        usual = np.exp(np.mean(np.log(spreads)))
        motions += [scaled(motion, usual / spread) for motion, spread in zip(some, spreads, strict=True)]
        roles += [role] * len(some)
    return learnt(motions, lids, roles, joins="shifts", most_blinks=BLINKS)


def most_of(person: list[Motion]) -> Motion:
    """Up to MOST_S of the pieces of a person."""
    before_s = np.cumsum([0.0, *(piece.duration_s for piece in person)])[:-1]
    return in_one([piece for piece, since_s in zip(person, before_s, strict=True) if since_s < MOST_S])


def scaled(motion: Motion, gain: float) -> Motion:
    return replace(motion, eyes=motion.eyes * np.array([1.0, gain, gain], np.float32))


PROVENANCE = {
    "performer": "gaze: twelve people of gaze_conversation, two of head_conversation; lids: GRID talker s1",
    "sources": [
        "Eye gaze during conversation (ETRA 2024)",
        "https://github.com/MCMartinLee/Conversation_Demo",
        "https://doi.org/10.1121/1.2229005",
    ],
    "licences": [
        "Apache-2.0: Dembinsky, Watanabe, Dengel, Ishimaru 2024 (gaze)",
        "MIT: MCMartinLee, Conversation_Demo (gaze beside heads)",
        "CC BY 4.0: Cooke, Barker, Cunningham, Shao 2006 (lids)",
    ],
    "consents": ["as the data sets state"],
    "synthetic": False,
}


def draw(person: Motion, lids: list[Motion], packaged: Eyes, path: Path) -> None:
    """20 s of a person's head with the eyes that were recorded with it (lids: of the other corpus), and with grown ones."""
    from matplotlib.figure import Figure

    part = slice(round(100 * HEAD_FPS), round(120 * HEAD_FPS))
    recorded = Motion(person.frames[part], HEAD_FPS, LAYOUT, person.head[part], person.eyes[part])
    shown = Lids.of(lids)
    seen = np.concatenate([shown.opening(motion)[:, 0] for motion in lids])[: round(20 * lids[0].fps)]
    made = packaged.look(recorded, seed=1, phones=said("speaking", 20.0), turning=False)
    figure = Figure(figsize=(12, 6), layout="constrained")
    axes = figure.subplots(3, 2, sharex=True, sharey="row")
    for column, (title, motion) in enumerate({"recorded": recorded, "grown": made}.items()):
        for row, (name, track) in enumerate(
            {"head to the left": motion.head[:, 1], "gaze to the left": motion.eyes[:, 1]}.items()
        ):
            axes[row, column].plot(motion.times_s, np.degrees(track), lw=0.9)
            axes[row, column].set_ylabel(f"{name}, °")
        axes[1, column].plot(motion.times_s, np.degrees(motion.eyes[:, 2]), lw=0.9, color="0.6")
        axes[0, column].set_title(title)
    axes[2, 0].plot(np.arange(len(seen)) / lids[0].fps, seen, lw=0.9)
    axes[2, 1].plot(made.times_s, made.eyes[:, 0], lw=0.9)
    axes[2, 0].set(ylabel="lids open", xlabel="s (lids: another talker, recordings of 3 s in a row)")
    axes[2, 1].set(xlabel="s (grey: gaze up)")
    figure.savefig(path, dpi=90)


def fitted_random(gaze: list[np.ndarray], fps: float) -> dict:
    """Rate and range of the recordings that are learned from."""
    kinds = pooled([fixation_statistics(one, fps) for one in gaze])
    away = np.concatenate([one - np.median(one, axis=0) for one in gaze])
    return {"shifts_s": max(float(kinds["fixation, s"].mean()), 0.05), "reach": np.quantile(np.abs(away), 0.95, axis=0)}


def mean_rows(parts: list[dict[str, dict[str, float]]]) -> dict[str, dict[str, float]]:
    return {row: {name: float(np.mean([part[row][name] for part in parts])) for name in parts[0][row]} for row in parts[0]}


def fixation_rows(seen: People, role: str, others_people: list[Motion]) -> dict[str, dict[str, float]]:
    parts = []
    for left_out, own in enumerate(seen[role]):
        others = [piece for k, person in enumerate(seen[role]) if k != left_out for piece in person]
        recorded = pooled([fixation_statistics(piece.eyes[:, 1:].astype(np.float64), FIXATION_FPS) for piece in own])
        if len(recorded["fixation, s"]) < FEWEST:
            continue
        chance = fitted_random([piece.eyes[:, 1:].astype(np.float64) for piece in others], FIXATION_FPS)
        persons = [in_one(person) for k, person in enumerate(seen[role]) if k != left_out and person]
        lengths = lengths_like(own)
        still = at_rest(LAYOUT, sum(lengths), FIXATION_FPS)
        made = {
            "texture synthesis": eyes_of(learnt(persons), still, left_out),
            "joined anywhere, as in the dissertation": eyes_of(learnt(persons, joins="anywhere"), still, left_out),
            "the package's model without the person": eyes_of(as_packaged(seen, others_people, left_out), still, left_out, role),
            "texture synthesis by two people of head_conversation": eyes_of(learnt(others_people), still, left_out),
            "constants": quiet_eyes(np.zeros((len(still), 6)), FIXATION_FPS, None, left_out),
            "random gaze": random_eyes(len(still), FIXATION_FPS, **chance, blinks=17, seed=left_out),
        }
        parts.append(
            {
                row: distances(pooled([fixation_statistics(gaze, FIXATION_FPS) for gaze in cut(eyes[:, 1:], lengths)]), recorded)
                for row, eyes in made.items()
            }
        )
    return mean_rows(parts)


def eyes_of(model: Eyes, motion: Motion, seed: int, role: str | None = None) -> np.ndarray:
    """[T, 3] eyes beside a head as it was recorded, or where somebody looks: no head follows."""
    phones = None if role is None else said(role, motion.duration_s)
    return model.look(motion, seed=seed, phones=phones, turning=False).eyes


def said(role: str, duration_s: float) -> PhoneTrack:
    """Phones of somebody who speaks, or is silent, nearly all the time."""
    labels = ("pau", "aa") if role == "speaking" else ("aa", "pau")
    return PhoneTrack(labels, np.array([0.01, duration_s]))


def lengths_like(pieces: list[Motion]) -> list[int]:
    """Lengths, frames, of the pieces, again and again for GROWN_S: what the ends of pieces cut off is cut off everywhere."""
    lengths: list[int] = []
    while sum(lengths) < GROWN_S * FIXATION_FPS:
        lengths += [len(piece) for piece in pieces]
    return lengths


def cut(gaze: np.ndarray, lengths: list[int]) -> list[np.ndarray]:
    """A gaze in pieces of these lengths."""
    return np.split(gaze.astype(np.float64), np.cumsum(lengths)[:-1])


def gaze_rows(people: list[Motion], seen: People) -> dict[str, dict[str, float]]:
    parts = []
    elsewhere = [piece.eyes[:, 1:].astype(np.float64) for persons in seen.values() for person in persons for piece in person]
    for left_out, own in enumerate(people):
        others = [person for k, person in enumerate(people) if k != left_out]
        recorded = gaze_statistics(own.eyes[:, 1:].astype(np.float64), own.head, HEAD_FPS)
        chance = fitted_random([other.eyes[:, 1:].astype(np.float64) for other in others], HEAD_FPS)
        far_chance = fitted_random(elsewhere, FIXATION_FPS)
        made = {
            "texture synthesis": eyes_of(learnt(others), own, left_out),
            "joined anywhere, as in the dissertation": eyes_of(learnt(others, joins="anywhere"), own, left_out),
            "texture synthesis that undoes 0.6": eyes_of(learnt(others, compensation=COMPENSATION), own, left_out),
            "constants": quiet_eyes(own.head, HEAD_FPS, None, left_out),
            "random gaze": random_eyes(len(own), HEAD_FPS, **chance, blinks=17, seed=left_out),
            "the package's model without the person": eyes_of(as_packaged(seen, others), own, left_out),
            "the package's, as if the person spoke": eyes_of(as_packaged(seen, others), own, left_out, "speaking"),
            "random gaze by gaze_conversation": random_eyes(len(own), HEAD_FPS, **far_chance, blinks=17, seed=left_out),
        }
        # what was not learned from averaged gaze is averaged as the recordings were
        learned = [row for row in made if "synthesis" in row or "anywhere" in row or row.endswith("without the person")]
        gazes = {row: averaged(eyes[:, 1:].astype(np.float64), 1 if row in learned else AVERAGED) for row, eyes in made.items()}
        parts.append({row: distances(gaze_statistics(gaze, own.head, HEAD_FPS), recorded) for row, gaze in gazes.items()})
    return mean_rows(parts)


def blink_rows(lids: list[Motion]) -> dict[str, dict[str, float]]:
    """Recordings of 3 s each, and as many as long of each row."""
    shown, parts = Lids.of(lids), []
    for half in (0, 1):
        own, others = lids[half::2], lids[1 - half :: 2]
        whole = [motion for motion in own if np.isfinite(motion.eyes).all()]
        recorded = pooled([blink_statistics(shown.opening(motion)[:, 0], motion.fps) for motion in whole])
        rate = blinks_a_minute(others, shown)
        model = learnt(others)
        rows = {
            "texture synthesis": lambda motion, seed, model=model: model.look(motion, seed=seed).eyes,
            "constants": lambda motion, seed: quiet_eyes(np.zeros((len(motion), 6)), motion.fps, None, seed),
            "Poisson blinks": lambda motion, seed, rate=rate: random_eyes(len(motion), motion.fps, 1.0, np.ones(2), rate, seed),
        }
        parts.append(
            {
                row: distances(
                    pooled([blink_statistics(make(m, k)[:, 0].astype(np.float64), m.fps) for k, m in enumerate(whole)]), recorded
                )
                for row, make in rows.items()
            }
        )
    return mean_rows(parts)


def blinks_a_minute(motions: list[Motion], shown: Lids) -> float:
    whole = [motion for motion in motions if np.isfinite(motion.eyes).all()]
    return float(np.mean(pooled([blink_statistics(shown.opening(m)[:, 0], m.fps) for m in whole])["blinks a minute"]))


if __name__ == "__main__":
    main()
