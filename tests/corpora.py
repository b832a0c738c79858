"""A small corpus for everybody's tests: written in a moment, the same every time."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from facesynth.corpus import Corpus, Record
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech

EMOTIONS = ("neutral", "happy", "angry", "sad")
RATE = 16000

POINTS = {
    "forehead_r": (-30, 50, 60),
    "forehead_l": (30, 50, 60),
    "nose_bridge": (0, 5, 80),
    "brow_r": (-25, 25, 70),
    "brow_l": (25, 25, 70),
    "eyelid_r": (-30, 2, 65),
    "eyelid_l": (30, 2, 65),
    "cheek_r": (-40, -30, 60),
    "cheek_l": (40, -30, 60),
    "lip_upper": (0, -50, 85),
    "lip_lower": (0, -51, 84),
    "corner_r": (-24, -51, 75),
    "corner_l": (24, -51, 75),
    "chin": (0, -85, 75),
}
"""Rest positions, mm."""
_GROUPS = {
    "mouth": ("lip_upper", "lip_lower", "corner_r", "corner_l"),
    "lips_inner": ("lip_upper", "lip_lower"),
    "upper_lip": ("lip_upper",),
    "lower_lip": ("lip_lower",),
    "jaw": ("chin",),
    "brows": ("brow_r", "brow_l"),
    "eyelids": ("eyelid_r", "eyelid_l"),
    "cheeks": ("cheek_r", "cheek_l"),
    "upper_face": ("brow_r", "brow_l", "eyelid_r", "eyelid_l", "forehead_r", "forehead_l"),
    "rigid": ("forehead_r", "forehead_l", "nose_bridge"),
}
_NAMES = tuple(POINTS)
_INDEX = {name: i for i, name in enumerate(_NAMES)}

# (jaw opening, lip rounding, lip pressing) of a few phones; the others lie between.
_POSES = {"pau": (0, 0, 0), "aa": (1, 0, 0), "ae": (0.9, -0.4, 0), "iy": (0.3, -1, 0), "uw": (0.3, 1, 0), "ow": (0.6, 0.7, 0)}
_POSES |= {"ah": (0.7, 0, 0), "eh": (0.6, -0.5, 0), "ih": (0.4, -0.6, 0), "p": (0, 0, 1), "b": (0, 0, 1), "m": (0, 0, 1)}
_POSES |= {
    "s": (0.15, -0.5, 0),
    "t": (0.2, -0.2, 0),
    "n": (0.25, 0, 0),
    "k": (0.35, 0, 0),
    "f": (0.1, 0, 0.6),
    "w": (0.2, 1, 0.2),
}
_VOWELS = ("aa", "ae", "iy", "uw", "ow", "ah", "eh", "ih")
_CONSONANTS = ("p", "b", "m", "s", "t", "n", "k", "f", "w")


def tiny_layout() -> Layout:
    """14 markers with every usual group and one pair of lip points."""
    groups = {name: tuple(_INDEX[p] for p in points) for name, points in _GROUPS.items()}
    neutral = tuple(float(v) for point in POINTS.values() for v in point)
    return Layout("markers", _NAMES, groups, ((_INDEX["lip_upper"], _INDEX["lip_lower"]),), neutral)


def tiny_corpus(path: str | Path, utterances: int = 12, fps: float = 120, seed: int = 0) -> Corpus:
    """Sentences of invented words, each in two emotions, every third of them in a second take; four emotions in all.

    Motion is smooth, depends on the phones, closes the lips at p, b, m, and is shifted by the emotion. Nothing is
    missing. The same arguments give the same bytes.
    """
    corpus = Corpus.create(
        path,
        performer="Tiny",
        layout=tiny_layout(),
        fps=fps,
        emotions=EMOTIONS,
        synthetic=True,
        licence="CC0-1.0",
        consent="none needed",
    )
    for record, speech, motion in tiny_utterances(utterances, fps, seed):
        corpus.add_utterance(record, speech, motion)
    return corpus


def tiny_utterances(utterances: int = 12, fps: float = 120, seed: int = 0) -> list[tuple[Record, Speech, Motion]]:
    """What `tiny_corpus` adds."""
    return [_utterance(*plan, fps, seed) for plan in _plan(utterances)]


def _plan(utterances: int) -> list[tuple[int, str, int]]:
    """(sentence, emotion, take): sentence 0 in neutral and happy, 1 in angry and sad, and so on."""
    plan: list[tuple[int, str, int]] = []
    sentence = 0
    while len(plan) < utterances:
        first = 2 * (sentence % 2)
        plan += [(sentence, EMOTIONS[first], 1), (sentence, EMOTIONS[first + 1], 1)]
        plan += [(sentence, EMOTIONS[first], 2)] if sentence % 3 == 0 else []
        sentence += 1
    return plan[:utterances]


def _utterance(sentence: int, emotion: str, take: int, fps: float, seed: int) -> tuple[Record, Speech, Motion]:
    words = np.random.default_rng([seed, sentence])
    rng = np.random.default_rng([seed, sentence, EMOTIONS.index(emotion), take])
    labels = ["pau"]
    for _ in range(int(words.integers(4, 7))):
        labels += [str(words.choice(_CONSONANTS)), str(words.choice(_VOWELS))]
    labels.append("pau")
    lengths_s = np.where(np.isin(labels, _VOWELS), 0.12, 0.08) * rng.uniform(0.85, 1.15, len(labels))
    lengths_s[[0, -1]] = 0.2
    phones = PhoneTrack(tuple(labels), np.round(np.cumsum(lengths_s), 3))
    text = " ".join(a + b for a, b in zip(labels[1:-1:2], labels[2:-1:2], strict=True))
    record = Record(f"s{sentence:02d}_{emotion}_t{take}", text, f"s{sentence:02d}", emotion, take=take)
    speech = Speech(_audio(phones, emotion, rng), RATE, phones, EmotionTrack.constant(emotion, phones.duration_s), text)
    return record, speech, _motion(phones, emotion, fps, rng)


def _audio(phones: PhoneTrack, emotion: str, rng: np.random.Generator) -> np.ndarray:
    """A hum for vowels and noise for consonants, higher and louder in some emotions."""
    seconds = np.arange(round(phones.duration_s * RATE)) / RATE
    index = np.minimum(np.searchsorted(phones.ends_s, seconds, side="right"), len(phones) - 1)
    voiced = np.isin(phones.labels, _VOWELS)[index]
    silent = (np.array(phones.labels) == "pau")[index]
    pitch = 110 + 25 * EMOTIONS.index(emotion)
    formant = np.array([300 + 120 * sorted(_POSES).index(label) for label in phones.labels])[index]
    hum = np.sin(2 * np.pi * pitch * seconds) + 0.5 * np.sin(2 * np.pi * formant * seconds)
    noise = rng.standard_normal(len(seconds))
    return (np.where(silent, 0.001, 0.12) * np.where(voiced, hum, 0.3 * noise)).astype(np.float32)


def _motion(phones: PhoneTrack, emotion: str, fps: float, rng: np.random.Generator) -> Motion:
    from scipy.ndimage import gaussian_filter1d

    layout = tiny_layout()
    bounds = phones.frame_bounds(fps)
    targets = np.repeat([_POSES[label] for label in phones.labels], np.diff(bounds), axis=0).astype(float)
    jaw, rounding, press = gaussian_filter1d(targets, 0.02 * fps, axis=0, mode="nearest").T
    mood = EMOTIONS.index(emotion) + 0.1 * rng.standard_normal()
    sway = gaussian_filter1d(rng.standard_normal((len(targets), 9)), 0.15 * fps, axis=0, mode="nearest") * np.sqrt(fps) / 4
    points = np.tile(np.array([POINTS[name] for name in _NAMES], float), (len(targets), 1, 1))
    opening = 12 * jaw * (1 - np.clip(1.6 * press, 0, 1))
    points[:, _INDEX["lip_lower"], 1] -= opening
    points[:, _INDEX["lip_upper"], 1] += 0.15 * opening
    points[:, _INDEX["chin"], 1] -= 14 * jaw
    points[:, [_INDEX["lip_upper"], _INDEX["lip_lower"]], 2] += (4 * rounding)[:, None]
    smile = {"happy": 4, "sad": -3, "angry": -1.5}.get(emotion, 0) * (1 + 0.1 * rng.standard_normal())
    for side, sign in (("r", 1), ("l", -1)):
        points[:, _INDEX[f"corner_{side}"], 0] += sign * (5 * rounding - 0.5 * smile)
        points[:, _INDEX[f"corner_{side}"], 1] += smile - 3 * jaw
        points[:, _INDEX[f"cheek_{side}"], 1] += 0.6 * smile - jaw
        points[:, _INDEX[f"brow_{side}"], 1] += {"happy": 1, "angry": -4, "sad": 3}.get(emotion, 0) + 0.3 * mood + sway[:, 0]
    points += 0.02 * rng.standard_normal(points.shape)
    head = np.concatenate([0.05 * sway[:, 1:4], sway[:, 4:7]], axis=1)
    blink = 1 - np.exp(-(((np.arange(len(targets)) - rng.uniform(0, len(targets))) / (0.05 * fps)) ** 2))
    eyes = np.column_stack([np.clip(blink, 0, 1), 0.1 * sway[:, 7:9]])
    return Motion(
        points.reshape(len(targets), -1).astype(np.float32), fps, layout, head.astype(np.float32), eyes.astype(np.float32)
    )


def label_lines(phones):
    """A track of phones as lines of `end label`."""
    return "".join(f"{end_s:.6f} {label}\n" for label, end_s in zip(phones.labels, phones.ends_s, strict=True))


def twin_corpus(path, emotions=("neutral", "happy", "sad"), sentences=8, *, fps=60, shift=None):
    """Sentences of the tiny performer in each of the emotions, with the same phones at other times."""
    layout = tiny_layout()
    corpus = Corpus.create(
        path, performer="Twin", layout=layout, fps=fps, emotions=("neutral", "happy", "sad"), licence="CC0-1.0"
    )
    for number, (record, speech, motion) in enumerate(tiny_utterances(3 * sentences, fps)):
        if record.emotion != "neutral" or record.take > 1:
            continue
        for emotion in emotions:
            moved = motion if emotion == "neutral" else _felt(motion, emotion, number)
            named = Record(f"{record.sentence}_{emotion}", record.text, record.sentence, emotion)
            track = EmotionTrack.constant(emotion, speech.duration_s)
            said = replace(speech, emotions=track)
            if emotion != "neutral" and shift is not None:
                said, moved = shift(said, moved)
            corpus.add_utterance(named, said, moved)
    return Corpus.open(path)


def _felt(motion, emotion, seed):
    """Brows that rise and fall slowly, corners that are held: what is added knows nothing of the phones."""
    layout, frames = motion.layout, motion.frames.copy()
    wave = np.sin(2 * np.pi * (0.7 * motion.times_s + seed / 5))
    size = {"happy": 4.0, "sad": -3.0}[emotion]
    frames[:, layout.columns("brows")[1::3]] += (size + wave)[:, None]
    frames[:, layout.columns("mouth")[1::3][2:]] += size
    frames[:, layout.columns("eyelids")[1::3]] -= 5
    return Motion(frames, motion.fps, layout)
