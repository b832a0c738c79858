"""Speech as long as a paper's: utterances one after the other, cut where enough is said."""

from collections.abc import Sequence

import numpy as np

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech


def joined(speeches: Sequence[Speech], phones: int) -> Speech:
    """The first `phones` phones of what is said one after the other; over again where there are too few."""
    if len({speech.sample_rate for speech in speeches}) != 1:
        raise FacesynthError("only speech of one sample rate can be joined; got none, or several")
    pieces: list[Speech] = []
    while sum(len(piece.phones) for piece in pieces) < phones:
        pieces.append(speeches[len(pieces) % len(speeches)])
    starts = np.concatenate([[0.0], np.cumsum([piece.phones.duration_s for piece in pieces])])
    labels = [label for piece in pieces for label in piece.phones.labels][:phones]
    ends = np.concatenate([start + piece.phones.ends_s for start, piece in zip(starts, pieces, strict=False)])[:phones]
    felt = [piece.emotions.per_phone(piece.phones) for piece in pieces]
    emotions = [emotion for names, _ in felt for emotion in names][:phones]
    intensities = np.concatenate([values for _, values in felt])[:phones]
    rate = speeches[0].sample_rate
    sound = np.concatenate([_as_long(piece, rate) for piece in pieces])[: round(ends[-1] * rate)]
    return Speech(sound, rate, PhoneTrack(tuple(labels), ends), EmotionTrack(tuple(emotions), ends, intensities))


def phones_until(speeches: Sequence[Speech], seconds: float) -> int:
    """How many phones of such speech last `seconds`."""
    said, lasted = 0, 0.0
    for number in range(10_000):
        track = speeches[number % len(speeches)].phones
        if lasted + track.duration_s >= seconds:
            return said + max(1, int(np.searchsorted(track.ends_s, seconds - lasted, side="right")))
        said, lasted = said + len(track), lasted + track.duration_s
    raise FacesynthError("what is said lasts no time at all")


def _as_long(speech: Speech, rate: int) -> np.ndarray:
    """The sound, cut or filled with silence to the end of the last phone."""
    count = round(speech.phones.duration_s * rate)
    return np.pad(speech.audio[:count], (0, max(0, count - len(speech.audio))))
