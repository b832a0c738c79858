"""Phones and words in files that people edit: Praat's TextGrid, and lines of `end label`."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from facesynth.atomic import write_text
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.label_lines import NUMBER, in_seconds, line_segments
from facesynth.speech.phone_labels import label_remarks, notation_of
from facesynth.speech.praat import Grid, read_grid
from facesynth.speech.segments import TOUCHING_S, Segment, phone_track, segments_of, with_confidences
from facesynth.speech.tiers import following, tiers_of
from facesynth.speech.unknown_labels import with_stand_ins

Words = tuple[Segment, ...]
"""Word, start and end in seconds; silence between words is left out."""
SAME_LENGTH_S = 0.2
"""A stretch of labels and a sound whose lengths differ by no more are of the same thing."""


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
    begin_s, end_s = _span_s(grid, phones.intervals, duration_s)
    segments, mended = following(_shifted(phones.intervals, begin_s))
    said = following(_shifted(words.intervals if words else (), begin_s))[0]
    spoken = tuple((word.strip(), start_s, end_s) for word, start_s, end_s in said if not is_silence_mark(word))
    sure = _shifted(confidences.intervals, begin_s) if confidences else []
    known, unread = _track(path, segments, end_s)
    track, unsure = _with_confidences(known, sure)
    labels = label_remarks(label for label, _, _ in segments)
    told = (*_encoded(grid.encoding), *remarks, *_moved(begin_s), *mended, *labels, *unread, *unsure)
    return Labelled(track, spoken, told)


def _with_confidences(track: PhoneTrack, said: Sequence[Segment]) -> tuple[PhoneTrack, tuple[str, ...]]:
    """The track with what a tier says of it, and what a person should know where that is no confidence."""
    given = [(label.strip(), start_s, end_s) for label, start_s, end_s in said if label.strip()]
    wrong = next((label for label, _, _ in given if not (NUMBER.fullmatch(label) and 0 <= float(label) <= 1)), None)
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
    given, told = line_segments(path)
    segments, counted = in_seconds(given, duration_s)
    start_s, end_s = (segments[0][1], segments[-1][2]) if segments else (0.0, 0.0)
    begin_s = _offset_s(start_s, end_s, duration_s)
    kept, mended = following(_shifted(segments, begin_s))
    labels = label_remarks(label for label, _, _ in segments)
    track, unread = _track(path, kept, None)
    return Labelled(track, (), (*told, *counted, *_moved(begin_s), *mended, *labels, *unread))


# A stretch that was cut out of a longer file may keep its times there: then it is as long as the sound, but does not lie in it.
def _offset_s(start_s: float, end_s: float, duration_s: float | None) -> float:
    """Seconds to take off all times; 0 where they are those of the sound."""
    if duration_s is None or abs(start_s) <= TOUCHING_S:
        return 0.0
    beside_s = abs(end_s - start_s - duration_s)
    return start_s if beside_s <= SAME_LENGTH_S and beside_s < abs(end_s - duration_s) else 0.0


def _span_s(grid: Grid, intervals: Sequence[Segment], duration_s: float | None) -> tuple[float, float]:
    """What is taken off all times, and where the labels then end: as the file's head says, else as its intervals lie."""
    spans = [(grid.start_s, grid.end_s), *([(intervals[0][1], intervals[-1][2])] if intervals else [])]
    head, own = spans[0], spans[-1]
    if own[0] < head[0] - TOUCHING_S or own[1] > head[1] + TOUCHING_S:  # the head is of another cut
        head = own
    if duration_s is not None and head[1] > duration_s + SAME_LENGTH_S and not _offset_s(*head, duration_s):
        head = own if _offset_s(*own, duration_s) else head
    begin_s = _offset_s(*head, duration_s)
    return begin_s, head[1] - begin_s


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
