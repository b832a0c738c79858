"""Which takes the built-in performer records, and where in the corpus they belong."""

from dataclasses import dataclass

import numpy as np

from facesynth.corpus.record import Record, Split
from facesynth.performer.prosody import EMOTIONS
from facesynth.performer.script import Sentence

TEST_EVERY = 6
"""Every sixth sentence is kept for testing, with all its emotions and takes."""
TAKES_EVERY, TAKES_AT, TAKES = 10, 2, 3
"""One sentence in ten is recorded three times; some of those are kept for testing, so that a second take can be judged."""


@dataclass(frozen=True)
class Take:
    """One sentence, said once."""

    sentence: Sentence
    emotion: str
    number: int
    """1 for the first take."""

    @property
    def id(self) -> str:
        """For example `s003_happy_t1`."""
        return f"{self.sentence.name}_{self.emotion}_t{self.number}"

    @property
    def split(self) -> Split:
        """By sentence."""
        return "test" if self.sentence.number % TEST_EVERY == 0 else "train"

    def seeds(self, seed: int) -> tuple[int, int, int]:
        """Independent seeds for the voice, the acting and the recording of this take."""
        key = np.random.SeedSequence([seed, self.sentence.number, EMOTIONS.index(self.emotion), self.number])
        voice, acting, recording = key.generate_state(3).tolist()
        return voice, acting, recording

    def record(self, unusable: str = "") -> Record:
        """Its line in utterances.csv; `unusable` is the reason, if there is one."""
        return Record(
            self.id,
            text=self.sentence.text,
            sentence=self.sentence.name,
            emotion=self.emotion,
            take=self.number,
            split=self.split,
            usable=not unusable,
            reason=unusable,
        )


def takes_of(sentence: Sentence) -> tuple[Take, ...]:
    """All emotions, and three takes of every tenth sentence."""
    count = TAKES if sentence.number % TAKES_EVERY == TAKES_AT else 1
    return tuple(Take(sentence, emotion, number) for emotion in EMOTIONS for number in range(1, count + 1))
