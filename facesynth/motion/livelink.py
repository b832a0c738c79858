"""Takes of the Live Link Face app, as the app and those who came after it write them.

A row a frame: the time of day, the number of values, weights of ARKit's shapes, and angles of head and eyes. Columns are found
by their names, whatever their order and case; the numbers may be shares or per cent, the text of any encoding, with commas or
semicolons. A row stands where its time code puts it: rows that were lost leave gaps, rows that are there twice are read once.
"""

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.encoding import decoded
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.motion.cells import EXCEL, without_idle_ends, without_preamble
from facesynth.motion.timecode import PARTS_OF_A_SECOND, RATES, read_timecodes

TIMECODE, COUNT = "Timecode", "BlendshapeCount"
ANGLES = tuple(f"{what}{angle}" for what in ("Head", "LeftEye", "RightEye") for angle in ("Yaw", "Pitch", "Roll"))
WEIGHTS = tuple(name[0].upper() + name[1:] for name in ARKIT_NAMES)
"""As the app spells them."""
FEWEST_SHAPES = 10
"""A table with a column of time codes and so many of ARKit's shapes is a take as well."""
HEAD_BYTES = 1 << 14
"""Hold the first line of any such table."""
PER_CENT = 2.0
"""No weight of shares goes beyond it."""
LARGEST_PER_CENT = 110.0
DOUBTFUL = 3.0
"""Below it the highest weight may be per cent of a quiet face, or a share that was exaggerated."""
FEW_OVER = 0.02
"""A larger share of weights over 1 is more than some that were captured a little beyond it."""
CLIPPED = 1.001
LARGEST_GAP = 50
"""Frames for each row: a table with larger gaps has damaged time codes."""
LARGEST_ANGLE_RAD = 1.8
"""Neither a head nor an eye turns so far before a camera: larger angles are degrees."""
SAME_CODE = 0.9
"""Share of the time codes that must stand in as many rows for these to be parts of a frame."""
_NUMBER = re.compile(r"\s*[-+]?\d*[.,]?\d+(?:[eE][-+]?\d+)?\s*%?\s*")
_BARE_DROP_FRAME = re.compile(r"(?<![\d\"])(\d{1,3}:\d\d:\d\d;\d{2,3}(?:[.,]\d+)?)(?=;)")


@dataclass(frozen=True, eq=False)
class Take:
    """A take as it stands in its file."""

    timecodes: tuple[str, ...]
    """R times of day."""
    names: tuple[str, ...]
    """N columns of numbers, spelled as the app does: weights and angles."""
    values: Floats
    """[R, N] weights as shares, angles in rad."""
    frames: NDArray[np.int64]
    """[R] number of the frame that each row shows, from 0 on."""
    fps: float
    """Hz."""
    remarks: tuple[str, ...]
    """What was assumed or repaired."""

    @property
    def weights(self) -> tuple[str, ...]:
        """Names of the columns that are no angles."""
        return tuple(name for name in self.names if name not in ANGLES)

    def has(self, angles: Sequence[str]) -> bool:
        """Whether the take holds these angles."""
        return set(angles) <= set(self.names)

    def rows(self, names: Sequence[str]) -> Floats:
        """[R, …] columns by name, as they stand in the file."""
        return self.values[:, [self.names.index(name) for name in names]]

    def laid(self, rows: Floats) -> Floats:
        """[T, C] rows [R, C] at their frames; NaN where one was lost."""
        found = np.full((int(self.frames[-1]) + 1, rows.shape[1]), np.nan)
        first = np.diff(self.frames, prepend=-1) > 0
        found[self.frames[first]] = rows[first]
        return found


def is_live_link(path: Path) -> bool:
    """Whether a table has the columns of a take, whatever their order, case and encoding."""
    try:
        with open(path, "rb") as file:
            names = {
                _spelled(name).lower() for name in _cells(without_preamble(decoded(file.read(HEAD_BYTES))[0]).splitlines()[:2])[0]
            }
    except (OSError, UnicodeDecodeError, csv.Error, IndexError):
        return False
    shapes = sum(name.lower() in names for name in WEIGHTS)
    return TIMECODE.lower() in names and (COUNT.lower() in names or shapes >= FEWEST_SHAPES)


def read_take(path: Path, fps: float | None = None) -> Take:
    """Read a take. Its rate is read off the time codes; one of under a second does not show it and needs `fps`.

    FacesynthError, with the row where one is at fault, for what is no take, cut off, or has time codes that go back.
    """
    header, rows, remarks = _table(path)
    names = [_spelled(name) for name in header]
    timecodes = [row[names.index(TIMECODE)].strip() for row in rows]
    columns = [k for k, name in enumerate(names) if name not in (TIMECODE, COUNT)]
    others = [k for k in columns if names[k] not in (*WEIGHTS, *ANGLES)]
    left_out = [k for k in others if not _holds_shares([row[k] for row in rows])]
    columns = [k for k in columns if k not in left_out]
    if left_out:
        remarks.append(f"columns that are no weights were left out: {', '.join(header[k][:40] for k in left_out[:5])}")
    values = _numbers(path, rows, columns)
    values, of_gaps = _without_lost_faces(path, values, [row[names.index(COUNT)] for row in rows] if COUNT in names else [])
    if any(row[k].endswith("%") for row in rows[:1] for k in columns):
        remarks.append("its cells are in per cent: they were divided by 100")
    named = tuple(names[k] for k in columns)
    values, said = as_shares(path, values, [name not in ANGLES for name in named])
    values, of_angles = _in_radians(values, [name in ANGLES for name in named])
    times_s, counted = read_timecodes(path, timecodes, fps)
    times_s, of_parts = _parted(times_s, values, counted)
    frames, rate = _placed(path, timecodes, times_s, counted, fps)
    remarks += of_gaps + said + of_angles + of_parts + _lost_and_doubled(frames, values)
    if fps is None and len({code[:8] for code in timecodes}) == 1:
        remarks.append(f"the time codes stay within one second: they were taken for a whole second of {counted} fps")
    return Take(tuple(timecodes), named, values, frames, rate, tuple(remarks))


def _holds_shares(cells: list[str]) -> bool:
    """Whether a column holds numbers as weights are; cells of a face that was lost are empty."""
    full = [cell for cell in cells if cell]
    return bool(full) and all(_NUMBER.fullmatch(cell) is not None and abs(_number(cell)) <= PER_CENT for cell in full)


def _without_lost_faces(path: Path, values: Floats, counts: list[str]) -> tuple[Floats, list[str]]:
    """Values [R, N] with NaN in rows that count no shapes while others do, and what was found missing."""
    empty = np.array([count == "0" for count in counts] or [False] * len(values))
    values = np.where(empty[:, None] & (not empty.all()), np.nan, values)
    missing = np.isnan(values)
    lost = missing.all(axis=1)
    if lost.all():
        raise FacesynthError(f"{path} holds no values in any row (empty or NaN); record the take again")
    single, whole = np.count_nonzero(missing[~lost]), np.count_nonzero(lost)
    return values, [
        *([f"{whole} of {len(values)} rows hold no values, as where the face was lost: they are gaps"] if whole else []),
        *([f"{single} cells hold no number: they are gaps"] if single else []),
    ]


def _in_radians(values: Floats, are_angles: list[bool]) -> tuple[Floats, list[str]]:
    """Values whose angles are radians, and what was done."""
    largest = float(np.nanmax(np.abs(values[:, are_angles]), initial=0.0))
    if largest <= LARGEST_ANGLE_RAD:
        return values, []
    said = f"angles of head and eyes go up to {largest:.3g}: they were taken as degrees"
    return np.where(are_angles, np.deg2rad(values), values), [said]


# Where rows come twice as fast as the time code counts, each code stands in two rows, whose values differ.
def _parted(times_s: Floats, values: Floats, counted: int) -> tuple[Floats, list[str]]:
    """Times [R] of rows that share a time code throughout, spread over the frame of that code; and what was done."""
    starts = np.flatnonzero(np.diff(times_s, prepend=-np.inf) != 0)
    lengths = np.diff([*starts, len(times_s)])
    usual = int(np.median(lengths))
    moved = np.flatnonzero(np.diff(times_s) == 0)
    differing = (values[moved] != values[moved + 1]).any(axis=1).mean() if len(moved) else 0.0
    if usual < 2 or (lengths == usual).mean() < SAME_CODE or differing < SAME_CODE:
        return times_s, []
    place = np.arange(len(times_s)) - np.repeat(starts, lengths)
    said = f"each time code stands in {usual} rows: they were taken for {usual * counted} frames a second"
    return times_s + place / (usual * counted), [said]


def _table(path: Path) -> tuple[list[str], list[list[str]], list[str]]:
    """Names of the columns, the rows below them, and what was noticed."""
    try:
        text, encoding = decoded(path.read_bytes())
        cells = without_idle_ends(_cells(without_preamble(text).splitlines())) or [[]]
        header, rows = cells[0], [row for row in cells[1:] if row != cells[0]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as a Live Link Face CSV ({error})") from None
    lower = [_spelled(name).lower() for name in header]
    known = sum(name.lower() in lower for name in (*WEIGHTS, *ANGLES))
    if lower.count(TIMECODE.lower()) != 1 or "" in header or len(set(lower)) != len(lower) or not known:
        odd = next(
            (name for name in header if lower.count(_spelled(name).lower()) > 1 or _spelled(name) == name.lower()),
            f"{header[:3]}",
        )
        raise FacesynthError(
            f"{path} cannot be read as a Live Link Face CSV: its header has {odd[:60]!r}; wanted Timecode, BlendshapeCount,"
            " weights and angles"
        )
    if not rows:
        raise FacesynthError(f"{path} holds a header and no frames; record the take again")
    for number, row in enumerate(rows, start=2):
        if row[1:2] == ["0"] and not any(row[2:]):  # a face that was lost: the time code and a count of 0
            row.extend([""] * (len(header) - len(row)))
        if len(row) != len(header):
            raise FacesynthError(f"{path} row {number} has {len(row)} values; wanted {len(header)}; was the take cut off?")
    return header, rows, [f"the text was taken for {encoding}"] if encoding else []


def _cells(lines: Sequence[str]) -> list[list[str]]:
    """Rows of a table with commas, semicolons or tabs, with decimal points or commas."""
    said = EXCEL.fullmatch(lines[0].strip()) if lines else None
    lines = lines[1:] if said else lines
    first = lines[0] if lines else ""
    sign = said[1] if said else next((sign for sign in (";", "\t") if first.count(sign) > first.count(",")), ",")
    text = "\n".join(lines)
    text = _BARE_DROP_FRAME.sub(r'"\1"', text) if sign == ";" else text
    return [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text), delimiter=sign) if row]


def _letters(name: str) -> str:
    return re.sub(r"[\s_-]", "", name)


def _variants(name: str) -> Iterator[str]:
    """A name in small letters, and with a letter for its side."""
    yield name
    for side in ("left", "right"):
        if name.endswith(side):
            yield f"{name.removesuffix(side)}_{side[0]}"


_SPELLED = {_letters(variant): name for name in (TIMECODE, COUNT, *WEIGHTS, *ANGLES) for variant in _variants(name.lower())}


def _spelled(name: str) -> str:
    """A column's name as the app writes it, whatever its case and the signs within and before it (`blendShape1.jaw_open`)."""
    plain = re.sub(r"^.*[.:|]|^arkit[_ ]?", "", name.strip().lower())
    return _SPELLED.get(_letters(name.lower())) or _SPELLED.get(_letters(plain), name)


def _number(cell: str) -> float:
    """A number with a decimal point or comma, NaN for none; per cent are shares."""
    plain = cell.replace(",", ".") or "nan"
    return float(plain[:-1]) / 100 if plain.endswith("%") else float(plain)


def _numbers(path: Path, rows: list[list[str]], columns: list[int]) -> Floats:
    try:
        values = np.array([[_number(row[k]) for k in columns] for row in rows], np.float64).reshape(len(rows), len(columns))
    except ValueError as error:
        raise FacesynthError(f"{path} holds a value that is no number ({error})") from None
    if np.isinf(values).any():
        raise FacesynthError(f"{path} holds infinite values; remove those rows")
    return values


def as_shares(path: Path, values: Floats, are_weights: list[bool]) -> tuple[Floats, list[str]]:
    """Values whose weights are shares of 1, and what was done."""
    weights = values[:, are_weights]
    highest = float(np.nanmax(weights, initial=0.0))
    lowest = float(np.nanmin(weights, initial=0.0))
    if highest > LARGEST_PER_CENT or lowest < -LARGEST_PER_CENT:
        raise FacesynthError(f"{path} holds weights up to {max(highest, -lowest):g}; wanted 0 to 1, or per cent")
    said = f"weights go up to {highest:g}"
    over = float((weights > CLIPPED).mean()) if weights.size else 0.0
    if highest > PER_CENT:
        doubt = ", which is doubtful: if they are exaggerated shares, clip them at 1" if highest < DOUBTFUL else ""
        return np.where(are_weights, values / 100, values), [f"{said}: they were taken as per cent and divided by 100{doubt}"]
    under = [f"weights go down to {lowest:g}: those under 0 are taken as 0"] if lowest < 1 - CLIPPED else []
    doubt = f", which is doubtful for {over:.0%} of all: if they are per cent of a quiet face, divide by 100"
    return values, [
        *([f"{said}: those over 1 are taken as 1{doubt if over > FEW_OVER else ''}"] if highest > CLIPPED else []),
        *under,
    ]


# Steps between time codes are whole multiples of a frame, give or take what the app's clock trembles. Each step is rounded by
# itself, so that the frame's length need not be known well; that gives the rate, and the rate the place of each row.
def _placed(
    path: Path, timecodes: list[str], times_s: Floats, counted: int, fps: float | None
) -> tuple[NDArray[np.int64], float]:
    """[R] the frame that each row shows, and the rate."""
    steps = np.diff(times_s)
    back = np.flatnonzero(steps < -0.5 / counted)
    if len(back):
        row = int(back[0])
        raise FacesynthError(
            f"{path} row {row + 3}: the time code goes back from {timecodes[row]} to {timecodes[row + 1]}, as where two takes"
            " were put together; cut the table there"
        )
    forward = steps[steps > 0.25 / counted]
    if not len(forward):
        if fps is None:
            raise FacesynthError(f"{path}: the time codes do not increase; give the rate (--fps)")
        return np.arange(len(times_s)), fps
    usual = _usual_step(forward)
    count = np.rint(steps / usual).sum()
    span_s = float(times_s[-1] - times_s[0])
    rate = _exact(float(count) / span_s, counted, span_s)
    frames = np.rint((times_s - times_s[0]) * rate).astype(np.int64)
    if frames[-1] > LARGEST_GAP * len(frames) + 1000:
        raise FacesynthError(f"{path}: the time codes jump by hours, from {timecodes[0]} to {timecodes[-1]}; export it again")
    return np.maximum.accumulate(frames), fps if fps is not None and abs(fps / rate - 1) < 1e-3 else rate


def _usual_step(steps: Floats) -> float:
    """Seconds from a row to the next: the mean of those near their median, for clocks run ahead often and fall back seldom."""
    median = float(np.median(steps))
    return float(steps[np.abs(steps - median) < median / 2].mean())


def _exact(rate: float, counted: int, span_s: float) -> float:
    """The rate of film or television that is meant by time codes that are rounded to parts of a second."""
    parts = () if counted in PARTS_OF_A_SECOND else (counted,)
    exact = [usual * slow for usual in (*RATES, *parts) for slow in (1.0, 1000 / 1001)]
    nearest = min(exact, key=lambda usual: abs(usual - rate))
    rounding = 1 / (counted * span_s) if counted in PARTS_OF_A_SECOND else 0.0
    return nearest if abs(nearest / rate - 1) < max(1e-4, rounding) else rate


def _lost_and_doubled(frames: NDArray[np.int64], values: Floats) -> list[str]:
    again = np.flatnonzero(np.diff(frames) == 0)
    remarks = []
    if len(again):
        same = np.count_nonzero((values[again] == values[again + 1]).all(axis=1))
        what = "are there twice" if same == len(again) else f"share a frame with the one before ({same} of them the same)"
        remarks.append(f"{len(again)} of {len(frames)} rows {what}; each frame was read once")
    lost = int(frames[-1]) + 1 - len(np.unique(frames))
    if lost:
        remarks.append(f"{lost} of {int(frames[-1]) + 1} frames have no row by the time codes: they are gaps")
    return remarks
