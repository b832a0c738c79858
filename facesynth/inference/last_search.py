"""What was found for the last speech, so that an account of it needs no second search."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar
from weakref import ref

import numpy as np

from .speech import EmotionTrack, Speech

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class _Asked:
    """What was searched for; neither sound nor phones are kept alive."""

    audio: ref[Any]
    phones: ref[Any]
    emotions: EmotionTrack
    options: tuple[Any, ...]

    def is_for(self, speech: Speech, options: tuple[Any, ...]) -> bool:
        """Whether it is the same speech with the same options."""
        same = self.audio() is speech.audio and self.phones() is speech.phones and self.options == options
        felt, feels = self.emotions, speech.emotions
        return (
            same
            and felt.labels == feels.labels
            and all(np.array_equal(getattr(felt, name), getattr(feels, name)) for name in ("ends_s", "intensities"))
        )


class LastSearch(Generic[T]):
    """Remembers what was found for one speech."""

    def __init__(self) -> None:
        self._last: tuple[_Asked, T] | None = None

    def keep(self, speech: Speech, options: tuple[Any, ...], found: T) -> T:
        """From now on this is what was found, with these options."""
        self._last = _Asked(ref(speech.audio), ref(speech.phones), speech.emotions, options), found
        return found

    def of(self, speech: Speech, options: tuple[Any, ...], search: Callable[[], T]) -> T:
        """What was found for this very speech; `search` finds it where another one was the last."""
        if self._last is not None and self._last[0].is_for(speech, options):
            return self._last[1]
        return self.keep(speech, options, search())
