"""Hard constraints: which recorded node must be said at which phone."""

import csv
from collections.abc import Mapping
from math import isfinite
from pathlib import Path

import numpy as np

from facesynth.corpus import node_name
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import PhoneTrack


def read_constraints(path: str | Path, phones: PhoneTrack) -> dict[int, str]:
    """A CSV with `phone_index` or `time_s`, then `utterance_id,phone_number`; gives phone index -> node name.

    Phones count from 0, silence included; a time belongs to the phone that it falls into.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            columns = reader.fieldnames or []
            place = next((c for c in ("phone_index", "time_s") if c in columns), None)
            if place is None or not {"utterance_id", "phone_number"} <= set(columns):
                raise FacesynthError(f"{path}: wanted columns phone_index or time_s, utterance_id, phone_number; got {columns}")
            return dict(_constraint(path, place, row, reader.line_num, phones) for row in reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path}: cannot read constraints ({error})") from None


def _constraint(path: str | Path, place: str, row: Mapping[str, str], line: int, phones: PhoneTrack) -> tuple[int, str]:
    try:
        value = float(row[place])
        number = int(row["phone_number"])
        if not isfinite(value):
            raise ValueError(value)
    except (TypeError, ValueError):
        raise FacesynthError(f"{path}, line {line}: {place} and phone_number must be numbers; got {dict(row)}") from None
    if place == "time_s":
        if not 0 <= value < phones.duration_s:
            raise FacesynthError(
                f"{path}, line {line}: {value} s is outside of the sound, which ends at {phones.duration_s:.3f} s"
            )
        return int(np.searchsorted(phones.ends_s, value, side="right")), node_name(row["utterance_id"], number)
    if value != int(value) or not 0 <= value < len(phones):
        raise FacesynthError(f"{path}, line {line}: there is no phone {row[place]}; the input has phones 0 to {len(phones) - 1}")
    return int(value), node_name(row["utterance_id"], number)
