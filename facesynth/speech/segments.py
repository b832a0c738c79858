"""From labelled stretches of time, as files and aligners give them, to a phone track without gaps."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.phone_labels import CLOSURES, Notation, normalise_phone, notation_of

Segment = tuple[str, float, float]
"""Label, start and end in seconds."""

TOUCHING_S = 1e-6
"""Ends and starts nearer than this are one boundary."""
SHORTEST_PHONE_S = 0.005


def phone_track(segments: Iterable[Segment], duration_s: float | None = None, notation: Notation | None = None) -> PhoneTrack:
    """The phones of labelled segments in order of time, any usual labels; gaps and the rest up to `duration_s` are silence.

    notation: that of the labels; without it, it is seen in them.
    A stop's closure joins its release (`bcl b` is one b), neighbouring silences become one.
    FacesynthError where segments overlap, run backwards or bear an unknown label.
    """
    whole = list(_filled(segments, duration_s))
    raw = [label.strip().lower() for label, _ in whole]
    notation = notation or notation_of(label for label, _ in whole)
    labels: list[str] = []
    ends_s: list[float] = []
    for number, (label, end_s) in enumerate(whole):
        phone = normalise_phone(label, notation)
        if labels and (phone == labels[-1] == SILENCE or _is_release(raw[number - 1], phone)):
            labels[-1], ends_s[-1] = phone, end_s
        else:
            labels.append(phone)
            ends_s.append(end_s)
    if not labels:
        raise FacesynthError("there is not one phone; at least one is needed")
    return PhoneTrack(tuple(labels), np.array(ends_s))


def segments_of(track: PhoneTrack) -> list[Segment]:
    """Label, start and end of each phone, seconds."""
    return list(zip(track.labels, track.starts_s.tolist(), track.ends_s.tolist(), strict=True))


def covering(track: PhoneTrack, duration_s: float) -> PhoneTrack:
    """The track made as long as the sound: cut at `duration_s`, or completed with silence."""
    kept = [(label, start, min(end, duration_s)) for label, start, end in segments_of(track) if start < duration_s - TOUCHING_S]
    if kept and duration_s - kept[-1][2] < TOUCHING_S:
        kept[-1] = (*kept[-1][:2], duration_s)
    whole = phone_track(kept, duration_s)
    if track.confidences is None:
        return whole
    return with_confidences(whole, [(*times, sure) for (_, *times), sure in zip(kept, track.confidences, strict=False)])


def with_confidences(track: PhoneTrack, said: Iterable[tuple[float, float, float]]) -> PhoneTrack:
    """The track with the confidence (start and end in seconds, 0 to 1) of each phone that begins and ends so; of others 1."""
    starts_s, ends_s, sure = np.array(sorted(said), np.float64).reshape(-1, 3).T
    confidences = np.ones(len(track))
    if len(sure):
        nearest = np.minimum(np.searchsorted(starts_s, track.starts_s - TOUCHING_S), len(sure) - 1)
        off_s = np.maximum(np.abs(starts_s[nearest] - track.starts_s), np.abs(ends_s[nearest] - track.ends_s))
        confidences = np.where(off_s <= TOUCHING_S, sure[nearest], 1.0)
    return replace(track, confidences=confidences)


def in_one(pieces: Iterable[tuple[float, float, Sequence[Segment]]]) -> list[Segment]:
    """Segments of pieces of a sound, each given with its start and length in seconds, in seconds of the whole sound."""
    return [
        (label, begin_s + start_s, begin_s + end_s)
        for begin_s, length_s, segments in pieces
        for label, start_s, end_s in within(segments, length_s)
    ]


def within(segments: Sequence[Segment], duration_s: float) -> list[Segment]:
    """Segments laid inside a sound: what reaches beyond its ends is pressed together.

    Pauses that lie outside go; phones keep at least SHORTEST_PHONE_S, where the sound is long enough for that.
    """
    kept = [s for s in segments if s[0] != SILENCE or (s[2] > SHORTEST_PHONE_S and s[1] < duration_s - SHORTEST_PHONE_S)]
    if not kept:
        return []
    room = min(SHORTEST_PHONE_S, duration_s / (len(kept) + 1)) * np.arange(len(kept) + 1)
    ends = np.maximum.accumulate(np.array([s[2] for s in kept]) - room[1:]) + room[1:]
    ends = np.clip(ends, room[1:], duration_s - room[-2::-1])
    starts = np.maximum([s[1] for s in kept], np.concatenate([[0.0], ends[:-1]]))
    starts = np.minimum(starts, ends - room[1])
    return [(s[0], float(a), float(b)) for s, a, b in zip(kept, starts, ends, strict=True)]


def _filled(segments: Iterable[Segment], duration_s: float | None) -> Iterable[tuple[str, float]]:
    """Label and end of each segment, with silence wherever time is left over."""
    now_s = 0.0
    for number, (label, start_s, end_s) in enumerate(segments, start=1):
        if not (np.isfinite([start_s, end_s]).all() and start_s >= now_s - TOUCHING_S and end_s > max(start_s, now_s)):
            raise FacesynthError(
                f"segment {number} ({label!r}) lies at {start_s:g} to {end_s:g} s, the one before ends at {now_s:g} s;"
                " segments must follow one another and have a length"
            )
        if start_s > now_s + TOUCHING_S:
            yield SILENCE, start_s
        yield label, end_s
        now_s = end_s
    if duration_s is not None and duration_s > now_s + TOUCHING_S:
        yield SILENCE, duration_s


def _is_release(label_before: str, phone: str) -> bool:
    """Whether `phone` is what opens the closure before it; affricates open a closure of t or d."""
    stop = CLOSURES.get(label_before)
    return stop is not None and (phone == stop or (stop, phone) in {("t", "ch"), ("d", "jh")})
