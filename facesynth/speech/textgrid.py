"""Phones and words in files that people edit: Praat's TextGrid, and lines of `end label`."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facesynth.atomic import write_text
from facesynth.encoding import decoded
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.phone_labels import label_remarks, notation_of
from facesynth.speech.praat import read_grid
from facesynth.speech.segments import TOUCHING_S, Segment, phone_track, segments_of, with_confidences
from facesynth.speech.tiers import following, tiers_of
from facesynth.speech.unknown_labels import with_stand_ins

Words = tuple[Segment, ...]
"""Word, start and end in seconds; silence between words is left out."""
SAME_LENGTH_S = 0.2
"""A stretch of labels and a sound whose lengths differ by no more are of the same thing."""
FAR_BEYOND = 50
"""Whole numbers that go so many times beyond the sound's end are no seconds."""
UNITS_S: Mapping[str, float] = {
    **{"units of 100 ns, as HTK counts": 1e-7, "milliseconds": 1e-3},
    **{f"samples at {rate} Hz, as TIMIT counts": 1 / rate for rate in (8000, 11025, 16000, 22050, 24000, 32000, 44100, 48000)},
}
_NUMBER = re.compile(r"[-+]?\d*\.?\d+(e[-+]?\d+)?", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Labelled:
    """What a file says of a sound."""

    phones: PhoneTrack
    words: Words
    remarks: tuple[str, ...]
    """What was assumed or mended, for a person."""


def read_labelled(path: str | Path, duration_s: float | None = None, speaker: str | None = None) -> Labelled:
    """Phones and words of a TextGrid, or phones of lines of `end label`, with what was assumed or mended.

    duration_s: length of the sound, by which times that were kept from a longer file are seen; speaker: whose phones.
    FacesynthError where they cannot be used.
    """
    path = Path(path)
    if not is_textgrid(path):
        return _from_lines(path, duration_s)
    grid = read_grid(path)
    phones, words, confidences, remarks = tiers_of(grid, path, speaker)
    begin_s = _offset_s(grid.start_s, grid.end_s, duration_s)
    segments, mended = following(_shifted(phones.intervals, begin_s))
    said = following(_shifted(words.intervals if words else (), begin_s))[0]
    spoken = tuple((word.strip(), start_s, end_s) for word, start_s, end_s in said if not is_silence_mark(word))
    sure = _shifted(confidences.intervals, begin_s) if confidences else []
    known, unread = _track(path, segments, grid.end_s - begin_s)
    track, unsure = _with_confidences(known, sure)
    labels = label_remarks(label for label, _, _ in segments)
    told = (*_encoded(grid.encoding), *remarks, *_moved(begin_s), *mended, *labels, *unread, *unsure)
    return Labelled(track, spoken, told)


def _with_confidences(track: PhoneTrack, said: Sequence[Segment]) -> tuple[PhoneTrack, tuple[str, ...]]:
    """The track with what a tier says of it, and what a person should know where that is no confidence."""
    given = [(label.strip(), start_s, end_s) for label, start_s, end_s in said if label.strip()]
    wrong = next((label for label, _, _ in given if not (_NUMBER.fullmatch(label) and 0 <= float(label) <= 1)), None)
    if wrong is not None:
        return track, (f"its tier of confidences says {wrong!r:.40} where a number from 0 to 1 was wanted, and is not used",)
    return (with_confidences(track, [(start_s, end_s, float(label)) for label, start_s, end_s in given]) if given else track), ()


def is_textgrid(path: str | Path) -> bool:
    """Whether a file of phones is a TextGrid by its name; else it is lines of `end label`."""
    return Path(path).suffix.lower() in (".textgrid", ".json")


def read_textgrid(path: str | Path) -> tuple[PhoneTrack, Words]:
    """Phones and words of a TextGrid (long, short, binary or JSON) with a tier `phones` and, if there is one, `words`.

    Names are matched loosely (`Phones`, `speaker - phones`, `word`); gaps in the tier of phones become silence;
    words that are empty or silence marks are left out. FacesynthError for anything else.
    """
    found = read_labelled(path)
    return found.phones, found.words


def write_textgrid(path: str | Path, phones: PhoneTrack, words: Sequence[Segment] = ()) -> None:
    """Write tiers `words` and `phones` as a TextGrid (long form, UTF-8), atomically; `read_textgrid` gives the same back.

    A tier `confidence` beside them says how sure each phone is, 0 to 1, where that is known. A phone whose times are no longer
    those of its confidence was corrected by somebody who vouches for it: its confidence is 1.
    """
    end_s = phones.duration_s
    said = [(word, start_s, min(stop_s, end_s)) for word, start_s, stop_s in words]
    tiers = {"words": list(_without_gaps(said, end_s)), "phones": segments_of(phones)}
    if phones.confidences is not None:
        sure = (f"{confidence:.2f}" for confidence in phones.confidences)
        tiers["confidence"] = [
            (said, begin_s, stop_s) for said, (_, begin_s, stop_s) in zip(sure, segments_of(phones), strict=True)
        ]
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "xmin = 0 ", f"xmax = {_number(end_s)} "]
    lines += ["tiers? <exists> ", f"size = {len(tiers)} ", "item []: "]
    for number, (name, segments) in enumerate(tiers.items(), start=1):
        about = ['class = "IntervalTier" ', f'name = "{name}" ', "xmin = 0 ", f"xmax = {_number(end_s)} "]
        lines += [f"    item [{number}]:", *(f"        {line}" for line in about)]
        lines.append(f"        intervals: size = {len(segments)} ")
        for index, (label, start_s, stop_s) in enumerate(segments, start=1):
            text = label.strip().replace('"', '""')
            values = [f"xmin = {_number(start_s)} ", f"xmax = {_number(stop_s)} ", f'text = "{text}" ']
            lines += [f"        intervals [{index}]:", *(f"            {value}" for value in values)]
    write_text(path, "\n".join(lines) + "\n")


def _from_lines(path: Path, duration_s: float | None) -> Labelled:
    segments, encoding = _line_segments(path)
    segments, counted = _in_seconds(segments, duration_s)
    start_s, end_s = (segments[0][1], segments[-1][2]) if segments else (0.0, 0.0)
    begin_s = _offset_s(start_s, end_s, duration_s)
    labels = label_remarks(label for label, _, _ in segments)
    track, unread = _track(path, _shifted(segments, begin_s), None)
    return Labelled(track, (), (*_encoded(encoding), *counted, *_moved(begin_s), *labels, *unread))


def _in_seconds(segments: list[Segment], duration_s: float | None) -> tuple[list[Segment], tuple[str, ...]]:
    """Segments whose times are whole numbers far beyond the sound's end in the unit that fits it best, and what is said of it."""
    last = segments[-1][2] if segments else 0.0
    whole = all(time == int(time) for _, *times in segments for time in times)
    if duration_s is None or not whole or last < FAR_BEYOND * duration_s:
        return segments, ()
    unit = min(UNITS_S, key=lambda name: abs(np.log(max(last * UNITS_S[name], 1e-12) / duration_s)))
    seconds = [(label, start * UNITS_S[unit], end * UNITS_S[unit]) for label, start, end in segments]
    return seconds, (f"its times go up to {last:.0f}: they were taken as {unit}",)


def _line_segments(path: Path) -> tuple[list[Segment], str]:
    """The segments of a file of lines, and its encoding where that had to be guessed."""
    segments: list[Segment] = []
    text, encoding = _text_of(path)
    for number, line in _lines(text):
        before_s = segments[-1][2] if segments else 0.0
        try:
            *times, label = _without_score(line.split())
            start_s, end_s = (before_s, *map(float, times))[-2:]
            if len(times) not in (1, 2) or not end_s > start_s >= before_s - 1e-6:
                raise ValueError
        except ValueError:
            raise FacesynthError(
                f"{path}, line {number}: {line!r} is not `end label` or `start end label`"
                f" with times that go on from {before_s:g} s"
            ) from None
        segments.append((label, start_s, end_s))
    return segments, encoding


def _without_score(cells: list[str]) -> list[str]:
    """A line without what HTK writes after a label: how likely it was."""
    return cells[:3] if len(cells) == 4 and _NUMBER.fullmatch(cells[3]) and not _NUMBER.fullmatch(cells[2]) else cells


# A stretch that was cut out of a longer file may keep its times there: then it is as long as the sound, but does not lie in it.
def _offset_s(start_s: float, end_s: float, duration_s: float | None) -> float:
    """Seconds to take off all times; 0 where they are those of the sound."""
    if duration_s is None or abs(start_s) <= TOUCHING_S:
        return 0.0
    beside_s = abs(end_s - start_s - duration_s)
    return start_s if beside_s <= SAME_LENGTH_S and beside_s < abs(end_s - duration_s) else 0.0


def _shifted(segments: Iterable[Segment], begin_s: float) -> list[Segment]:
    return [(label, start_s - begin_s, end_s - begin_s) for label, start_s, end_s in segments]


def _encoded(encoding: str) -> tuple[str, ...]:
    return (f"it is not UTF-8; it was read as {encoding}",) if encoding else ()


def _moved(begin_s: float) -> tuple[str, ...]:
    return (f"its times begin at {begin_s:g} s, as in a longer file; they were counted from 0",) if begin_s else ()


def _track(path: Path, segments: Iterable[Segment], end_s: float | None) -> tuple[PhoneTrack, tuple[str, ...]]:
    """The phones, and what is said of labels that are none."""
    try:
        given = list(segments)
        notation = notation_of(label for label, _, _ in given)
        known, remarks = with_stand_ins(given, notation)
        return phone_track(known, end_s, notation), remarks
    except FacesynthError as error:
        raise FacesynthError(f"{path}: {error}") from None


def _without_gaps(segments: Iterable[Segment], end_s: float) -> Iterator[Segment]:
    """Segments with an empty one wherever time is left over."""
    now_s = 0.0
    for label, start_s, stop_s in segments:
        if start_s > now_s:
            yield "", now_s, start_s
        if stop_s > max(start_s, now_s):
            yield label, max(start_s, now_s), stop_s
            now_s = stop_s
    if end_s > now_s:
        yield "", now_s, end_s


def _number(seconds: float) -> str:
    """The shortest digits that give the same number back."""
    return f"{seconds:.0f}" if abs(seconds - int(seconds)) <= 1e-14 * abs(seconds) else repr(float(seconds))


def is_silence_mark(word: str) -> bool:
    """Whether an aligner's word stands for none: `sil`, `sp`, empty and the like."""
    return word.strip().lower() in {"", "sp", "sil", "<sil>", "<eps>", "spn", "<unk>", "h#", "<p:>", "#", SILENCE}


def _text_of(path: Path) -> tuple[str, str]:
    if not path.is_file():
        raise FacesynthError(f"{path}: no such file of phones")
    try:
        return decoded(path.read_bytes())
    except UnicodeDecodeError:
        raise FacesynthError(f"{path} is not text in UTF-8; expected lines of `end label`") from None


def _lines(text: str) -> Iterable[tuple[int, str]]:
    """Number and text of each line that says something; of files of xwaves (header, `#`, `end colour label`) end and label."""
    stripped = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    head = next((k for k, (_, line) in enumerate(stripped) if line == "#"), -1)
    said = [(number, line) for number, line in stripped[head + 1 :] if line and not line.startswith("#")]
    if head < 0 or not any(_NUMBER.fullmatch(line.split()[1]) for _, line in said if len(line.split()) == 3):
        return said
    return [(number, f"{line.split()[0]} {line.split()[-1]}") for number, line in said]
