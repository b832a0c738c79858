"""Phones and words in files that people edit: Praat's TextGrid, and lines of `end label`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from facesynth.atomic import atomic_path, write_text
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.segments import Segment, phone_track, segments_of

Words = tuple[Segment, ...]
"""Word, start and end in seconds; silence between words is left out."""


def read_textgrid(path: str | Path) -> tuple[PhoneTrack, Words]:
    """Phones and words of a TextGrid (long, short or JSON) with a tier `phones` and, if there is one, `words`.

    Names are matched loosely (`Phones`, `speaker - phones`, `word`); gaps in the tier of phones become silence;
    words that are empty or silence marks are left out. FacesynthError for anything else.
    """
    grid = _opened(Path(path))
    phones, words = _tier(grid, "phone"), _tier(grid, "word")
    if phones is None:
        raise FacesynthError(
            f"{path} has no tier of intervals named 'phones'; its tiers are {', '.join(grid.tierNames) or 'none'}"
        )
    try:
        track = phone_track(_segments(phones), float(grid.maxTimestamp))
    except FacesynthError as error:
        raise FacesynthError(f"{path}: {error}") from None
    return track, () if words is None else tuple(entry for entry in _segments(words) if not is_silence_mark(entry[0]))


def write_textgrid(path: str | Path, phones: PhoneTrack, words: Sequence[Segment] = ()) -> None:
    """Write tiers `words` and `phones` as a TextGrid (long form, UTF-8), atomically; `read_textgrid` gives the same back."""
    from praatio.data_classes.interval_tier import IntervalTier
    from praatio.data_classes.textgrid import Textgrid

    end_s = phones.duration_s
    grid = Textgrid()
    grid.addTier(IntervalTier("words", [(start, min(end, end_s), word) for word, start, end in words], 0, end_s))
    grid.addTier(IntervalTier("phones", [(start, end, label) for label, start, end in segments_of(phones)], 0, end_s))
    with atomic_path(path) as part:
        grid.save(str(part), format="long_textgrid", includeBlankSpaces=True, minimumIntervalLength=None)


def read_label_lines(path: str | Path) -> PhoneTrack:
    """Phones from lines of `end label` or `start end label`, times in seconds; empty lines and `#` comments are passed over."""
    segments: list[Segment] = []
    for number, line in _lines(Path(path)):
        before_s = segments[-1][2] if segments else 0.0
        try:
            *times, label = line.split()
            start_s, end_s = (before_s, *map(float, times))[-2:]
            if len(times) not in (1, 2) or not end_s > start_s >= before_s - 1e-6:
                raise ValueError
        except ValueError:
            raise FacesynthError(
                f"{path}, line {number}: {line!r} is not `end label` or `start end label`"
                f" with times that go on from {before_s:g} s"
            ) from None
        segments.append((label, start_s, end_s))
    try:
        return phone_track(segments)
    except FacesynthError as error:
        raise FacesynthError(f"{path}: {error}") from None


def write_label_lines(path: str | Path, phones: PhoneTrack) -> None:
    """Write one `end label` a line, seconds, atomically."""
    write_text(path, "".join(f"{end_s:.6f} {label}\n" for label, _, end_s in segments_of(phones)))


def _opened(path: Path) -> Any:
    from praatio import textgrid
    from praatio.utilities.errors import PraatioException

    if not path.is_file():
        raise FacesynthError(f"{path}: no such TextGrid")
    try:
        return textgrid.openTextgrid(str(path), includeEmptyIntervals=True, reportingMode="silence", duplicateNamesMode="rename")
    except (PraatioException, ValueError, LookupError, TypeError, AttributeError) as error:
        raise FacesynthError(f"{path} is not a TextGrid that Praat would read ({error})") from None


def _tier(grid: Any, kind: str) -> Any:
    """The tier of intervals called `kind`s, else the first whose name contains `kind`, else None."""
    from praatio.data_classes.interval_tier import IntervalTier

    named = [name for name in grid.tierNames if kind in name.lower() and isinstance(grid.getTier(name), IntervalTier)]
    best = sorted(named, key=lambda name: name.lower() not in (kind, f"{kind}s"))
    return grid.getTier(best[0]) if best else None


def _segments(tier: Any) -> Iterable[Segment]:
    return ((entry.label, float(entry.start), float(entry.end)) for entry in tier.entries)


def is_silence_mark(word: str) -> bool:
    """Whether an aligner's word stands for none: `sil`, `sp`, empty and the like."""
    return word.strip().lower() in {"", "sp", "sil", "<sil>", "<eps>", "spn", "h#", "<p:>", "#", SILENCE}


def _lines(path: Path) -> Iterable[tuple[int, str]]:
    """Number and text of each line that says something."""
    if not path.is_file():
        raise FacesynthError(f"{path}: no such file of phones")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise FacesynthError(f"{path} is not text in UTF-8; expected lines of `end label`") from None
    stripped = ((number, line.strip()) for number, line in enumerate(text.splitlines(), start=1))
    return ((number, line) for number, line in stripped if line and not line.startswith("#"))
