"""Samples of a C3D: where they lie in the file, how many there are, and their numbers as each processor writes them."""

from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError

BLOCK = 512
"""Bytes that files are padded to."""
FULL = 65535
"""The highest count of 16 bits."""
READ_AT_ONCE = 1 << 22
"""Bytes, about."""
DIFFERENT = 1e-4
"""Share by which two statements of a rate differ."""


@dataclass(frozen=True)
class Form:
    """How a file writes its samples."""

    points: int
    analog_channels: int
    analog_per_frame: int
    """Samples of each channel for each frame of points."""
    fps: float
    scale: float
    """What whole numbers are multiplied with; 0 where the file holds floating-point numbers."""
    analog_scales: Floats
    """[channels]"""
    analog_offsets: Floats
    """[channels]"""
    start: int
    """First byte of the samples."""
    number: str
    """Type of a number, as numpy calls it."""
    is_dec: bool
    """Whether floating-point numbers are those of a VAX: other than IEEE's."""

    @property
    def frame_numbers(self) -> int:
        """Numbers that a frame takes: three coordinates and a residual of each point, and the analog samples."""
        return 4 * self.points + self.analog_channels * self.analog_per_frame

    @property
    def frame_bytes(self) -> int:
        """Bytes that a frame takes."""
        return self.frame_numbers * int(self.number[-1])


# Header and parameters state the same things twice. Programs leave the rate in one of them at 0, and an analog rate where there
# are no channels; where counts or the kind of numbers differ nobody can tell where a sample lies.
def form_of(reader: Any) -> tuple[Form, tuple[str, ...]]:
    """How a file that the library opened writes its samples, and what was noticed; FacesynthError where it contradicts itself."""
    header, points, channels = reader.header, int(reader.point_used), int(reader.analog_used)
    scale = float(reader.point_scale)
    _require_same("markers", header.point_count, points)
    _require_same("floating-point numbers", float(header.scale_factor) < 0, scale < 0)
    if not np.isfinite(scale) or scale == 0:
        raise FacesynthError(f"states that its numbers are to be multiplied with {scale:g}; export it again")
    per_frame = int(header.analog_per_frame) if channels else 0
    _require_same("analog samples in a frame", header.analog_count if channels else 0, channels * per_frame)
    fps, said = _rate(float(header.frame_rate), float(reader.point_rate))
    general, scales, offsets = reader.get_analog_transform_parameters()
    order = ">" if reader._dtypes.is_mips else "<"
    whole = "u2" if reader.analog_format_unsigned else "i2"
    form = Form(
        points,
        channels,
        per_frame,
        fps,
        max(scale, 0.0),
        np.asarray(scales * general, np.float64),
        np.asarray(offsets, np.float64),
        BLOCK * (_first_block(reader) - 1),
        order + ("f4" if scale < 0 else whole),
        bool(reader._dtypes.is_dec),
    )
    return form, said


def _first_block(reader: Any) -> int:
    """The block in which the samples begin, as the header says, else the parameters."""
    parameter = reader.get("POINT:DATA_START")
    stated = int(reader.header.data_block) or (int(parameter.uint16_value) if parameter is not None else 0)
    if stated < 2:
        raise FacesynthError("does not say where its samples begin; export it again")
    return stated


def _require_same(what: str, in_header: Any, in_parameters: Any) -> None:
    if in_header != in_parameters:
        raise FacesynthError(f"contradicts itself: {what} are {in_header} in its header, {in_parameters} below; export it again")


def _rate(in_header: float, in_parameters: float) -> tuple[float, tuple[str, ...]]:
    """The rate of the points, and what is said where the file states two."""
    usable = [rate for rate in (in_parameters, in_header) if np.isfinite(rate) and rate > 0]
    rate = usable[0] if usable else in_parameters
    if len(usable) < 2 or abs(usable[1] / rate - 1) <= DIFFERENT:
        return rate, ()
    return rate, (f"its header states {in_header:g} frames a second, its parameters {rate:g}, which was taken",)


def read_samples(file: BinaryIO, form: Form, length: int) -> tuple[Floats, NDArray[np.float32]]:
    """Points [T, K, 3] in the file's unit, NaN where the residual says that none was seen, and analog samples [channels, S]."""
    points = np.full((length, form.points, 3), np.nan)
    analog = np.zeros((form.analog_channels, length * form.analog_per_frame), np.float32)
    file.seek(form.start)
    step = max(1, READ_AT_ONCE // max(form.frame_bytes, 1))
    for first in range(0, length, step):
        count = min(step, length - first)
        rows = _numbers(file.read(count * form.frame_bytes), form).reshape(count, form.frame_numbers)
        seen = rows[:, : 4 * form.points].reshape(count, form.points, 4)
        if form.number[-2:] == "u2":  # only analog samples are without a sign
            seen = seen.astype(np.int16)
        places = seen[..., :3] * (form.scale or 1.0)
        is_gap = ~(seen[..., 3] > -1) | ~np.isfinite(places).all(axis=2)
        points[first : first + count] = np.where(is_gap[..., None], np.nan, places)
        if analog.size:
            samples = rows[:, 4 * form.points :].reshape(-1, form.analog_channels)
            heard = (samples - form.analog_offsets) * form.analog_scales
            analog[:, first * form.analog_per_frame : (first + count) * form.analog_per_frame] = heard.T
    return points, analog


# A VAX writes the two halves of a floating-point number in the other order, and its exponent is larger by 2: a quarter of what
# IEEE would read.
def _numbers(content: bytes, form: Form) -> NDArray[Any]:
    if not (form.is_dec and form.number[-2] == "f"):
        return np.frombuffer(content, form.number)
    halves = np.frombuffer(content, "<u2").reshape(-1, 2)[:, ::-1]
    return np.ascontiguousarray(halves).view("<f4").ravel() / np.float32(4)


# The header counts frames in 16 bits, so recordings of 65,536 frames and more are counted elsewhere, or wrongly. All the counts
# that a file may hold are looked at; the one that the size of the file bears out is taken, else what the size says.
def length_of(reader: Any, form: Form, size: int) -> tuple[int, tuple[str, ...]]:
    """How many frames the file holds, and what was noticed; FacesynthError where it is cut off."""
    each = form.frame_bytes
    room = size - form.start
    whole = room // each if each else 0
    stated = sorted(_stated_lengths(reader), reverse=True)
    for length in stated:
        if 0 < length <= whole and room - length * each < BLOCK + each:
            return length, ()
    if stated and min(stated) > 0 and max(stated) > whole and not any(length >= FULL for length in stated):
        raise FacesynthError(f"is cut off: it states {max(stated)} frames and holds {whole}; copy it again")
    counts = range(whole, max(whole - BLOCK // max(each, 1) - 2, FULL), -1)
    wrapped = next((count for count in counts for length in stated if length < FULL and (count - length) % (FULL + 1) == 0), None)
    if whole > FULL and (wrapped is not None or FULL in stated):
        count = wrapped or whole
        return count, ("the header cannot count so many frames; the size of the file tells them",)
    fitting = [length for length in stated if 0 < length <= whole]
    if fitting:
        return fitting[0], ()
    return whole, (f"the header states no length that the file bears out; it holds {whole} frames",)


def _stated_lengths(reader: Any) -> set[int]:
    """Every count of frames in the file."""
    lengths = {int(reader.header.last_frame) - int(reader.header.first_frame) + 1}
    ends = [reader.get(f"TRIAL:ACTUAL_{which}_FIELD") for which in ("START", "END")]
    if all(end is not None and len(end.bytes) >= 4 for end in ends):
        first, last = (int(words[0]) + (int(words[1]) << 16) for words in (end.uint16_array for end in ends))
        lengths.add(last - first + 1)
    for name in ("LONG_FRAMES", "FRAMES"):
        parameter = reader.get(f"POINT:{name}")
        if parameter is not None and len(parameter.bytes) >= 2:
            stated = parameter.float_value if len(parameter.bytes) >= 4 else parameter.uint16_value
            lengths |= {int(stated)} if np.isfinite(stated) else set()
    return lengths
