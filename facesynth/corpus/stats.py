"""What a corpus holds, in numbers."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from facesynth.corpus.corpus import Corpus
from facesynth.corpus.eyes import EyeStats, eye_stats
from facesynth.corpus.utterance import Utterance
from facesynth.inference.phones import PHONES, SILENCE
from facesynth.progress import track

_RARELY_WRITTEN = frozenset({SILENCE, "ax", "el", "em", "en"})
"""Most dictionaries write the reduced ones as ah, or ah and a consonant."""


@dataclass(frozen=True)
class CorpusStats:
    """What a corpus holds. All but `utterances` counts usable utterances alone."""

    performer: str
    synthetic: bool
    utterances: int
    usable: int
    minutes: float
    fps: float
    sentences: int
    emotions: Mapping[str, int]
    """Utterances by the emotion that fills most of each."""
    emotion_minutes: Mapping[str, float]
    second_takes: int
    """Utterances that repeat a sentence in the same emotion."""
    phones: Mapping[str, int]
    """How often each phone but silence occurs, most frequent first."""
    absent_phones: tuple[str, ...]
    diphones: int
    """Different pairs of successive phones, silence included."""
    diphones_per_minute: float
    samples: int
    """Points times frames as recorded."""
    filled_samples: int
    """Missing samples in gaps short enough to be filled."""
    missing_samples: int
    """Samples in gaps that stay open."""
    long_gaps: int
    eyes: EyeStats | None = None
    """Blinks and gaze, where recordings show them; those without sound too."""

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)

    def text(self) -> str:
        """A few lines for people."""
        share = 100 / max(self.samples, 1)
        kind = "synthetic" if self.synthetic else "recorded"
        lines = [
            f"{self.performer} ({kind}): {self.usable} usable of {self.utterances} utterances,"
            f" {self.minutes:.1f} minutes at {self.fps:g} fps",
            f"sentences         {self.sentences}, second takes {self.second_takes}",
            *(
                f"{name:<17} {count} utterances, {self.emotion_minutes[name]:.1f} minutes"
                for name, count in self.emotions.items()
            ),
            f"phones            {sum(self.phones.values())}; absent: {' '.join(self.absent_phones) or 'none'}",
            f"diphones          {self.diphones} different, {self.diphones_per_minute:.0f} per minute",
            f"missing samples   {self.filled_samples} filled ({self.filled_samples * share:.2f} %),"
            f" {self.missing_samples} open ({self.missing_samples * share:.2f} %) in {self.long_gaps} long gaps",
            *([self.eyes.text()] if self.eyes else []),
        ]
        return "\n".join(lines)


def stats(corpus: Corpus) -> CorpusStats:
    """Count what the usable utterances of a corpus hold."""
    seconds = dict.fromkeys(corpus.emotions, 0.0)
    emotions, phones, diphones = Counter[str](), Counter[str](), Counter[tuple[str, str]]()
    samples = filled = missing = gaps = 0
    for utterance_id in track(corpus.ids, "counting"):
        utterance, report = corpus.read(utterance_id)
        labels = utterance.speech.phones.labels
        emotions[utterance.emotion] += 1
        for emotion, length_s in _emotion_seconds(utterance):
            seconds[emotion] = seconds.get(emotion, 0.0) + length_s
        phones.update(label for label in labels if label != SILENCE)
        diphones.update(pairwise(labels))
        samples += report.samples
        filled += report.filled_samples
        missing += report.missing_samples
        gaps += len(report.long_gaps)
    minutes = sum(seconds.values()) / 60
    repeated = Counter((record.sentence_key, record.emotion) for record in corpus.usable_records)
    return CorpusStats(
        performer=corpus.performer,
        synthetic=corpus.synthetic,
        utterances=len(corpus.records),
        usable=len(corpus),
        minutes=round(minutes, 3),
        fps=corpus.fps,
        sentences=len({record.sentence_key for record in corpus.usable_records}),
        emotions={name: emotions[name] for name in seconds},
        emotion_minutes={name: round(length_s / 60, 3) for name, length_s in seconds.items()},
        second_takes=sum(count - 1 for count in repeated.values()),
        phones=dict(phones.most_common()),
        absent_phones=tuple(phone for phone in PHONES if phone not in phones and phone not in _RARELY_WRITTEN),
        diphones=len(diphones),
        diphones_per_minute=round(len(diphones) / minutes, 1) if minutes else 0.0,
        samples=samples,
        filled_samples=filled,
        missing_samples=missing,
        long_gaps=gaps,
        eyes=eye_stats(corpus),
    )


def _emotion_seconds(utterance: Utterance) -> list[tuple[str, float]]:
    emotions = utterance.speech.emotions
    return list(zip(emotions.labels, np.diff(emotions.ends_s, prepend=0.0).tolist(), strict=True))
