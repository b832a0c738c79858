"""Valid files with one thing changed, read in a process whose memory and time are limited.

python fuzzing.py FOLDER TRIALS KIND...   prints what came of each kind, as JSON.
"""

import io
import json
import resource
import signal
import struct
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
from c3d_files import content as content_of_c3d
from c3d_files import face, file
from fuzzing_files import c3d_changed, grid_changed, head_changed, places_of, whole_heads
from grids import PHONES, WORDS, long_grid
from scipy.io import savemat

from facesynth.corpus.importers.formats import read
from facesynth.face.rig.own_head import load_own_head
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.speech.textgrid import read_labelled

MOTION = ("livelink", "table", "npz", "mat", "beat", "c3d", "openface", "c3d fields")
KINDS = (*MOTION, "textgrid", "head")
MOST_BYTES, MOST_S, MOST_LETTERS = 1 << 30, 10, 600
CELLS = (
    " ",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "x",
    "0x10",
    "1,5",
    "1.5.2",
    "-",
    "999999999999",
    "-1",
    "100",
    "\N{ARABIC-INDIC DIGIT THREE}",
)
CELLS += ("", "null", "\0", '"')
SHAPES = ("'shape': (9999999999, ", "'shape': (-1, ", "'shape': ((")
ENCODINGS = ("utf-8", "utf-8", "utf-16", "utf-8-sig", "utf-32")
CODES = ("25:00:00:00.0", "12:00:00:99.9", "12:61:00:00.0", "12:00:00;00", "00:00:00:00.0", "12:00", "12:00:00:00.000.1")
NUMBERS = (0, 1, -1, 2, 127, 128, 255, 256, 32767, 32768, 65535)
ODD = (None, -1, 0, 1, 1e300, "x", "", [], {}, [[]], True, "1", float("nan"), 2**70)


def whole(kind, folder):
    """The bytes of a valid file of a kind; of heads those of each kind."""
    if kind == "head":
        return whole_heads(folder)
    if kind == "textgrid":
        return long_grid([("words", WORDS), ("A - phones", PHONES)]).encode()
    if kind == "c3d fields":
        return content_of_c3d(file(face(40)))
    path, rng = folder / f"whole.{suffix(kind)}", np.random.default_rng(3)
    weights = rng.random((40, 52))
    if kind == "livelink":
        from takes import timecodes_of, values_of, write

        write(path, timecodes_of(130), values_of(130))
    elif kind == "table":
        rows = np.column_stack([np.arange(40) / 30, weights])
        np.savetxt(path, rows, delimiter=",", header=",".join(["time_s", *ARKIT_NAMES]), comments="", fmt="%.5f")
    elif kind == "npz":
        np.savez(path, frames=weights.astype(np.float32), names=np.array(ARKIT_NAMES), fps=30.0, head=np.zeros((40, 6)))
    elif kind == "mat":
        savemat(path, {"frames": weights.T, "fps": 30.0, "take": {"xyz": weights, "rate": 30.0}})
        (folder / "channels.txt").write_text("\n".join(ARKIT_NAMES), encoding="utf-8")
    elif kind == "beat":
        frames = [{"weights": row.tolist(), "time": k / 60, "rotation": []} for k, row in enumerate(weights)]
        path.write_text(json.dumps({"names": list(ARKIT_NAMES), "frames": frames}), encoding="utf-8")
    elif kind == "openface":
        from openface_files import openface

        openface(path)
    else:
        from mocap_files import write_c3d

        points = np.array([[40, 60, 50], [-40, 60, 50], [0, -30, 70], [0, -70, 60.0]]) + rng.normal(0, 2, (60, 4, 3))
        write_c3d(path, points, labels=["brow_l", "brow_r", "lip", "chin"])
    return path.read_bytes()


def suffix(kind):
    suffixes = {"livelink": "csv", "table": "csv", "beat": "json", "openface": "csv", "c3d fields": "c3d"}
    return {**suffixes, "textgrid": "TextGrid", "head": "glb"}.get(kind, kind)


def changed(kind, content, rng):
    """A file with one thing changed, and its suffix; content: of a valid file, of heads those of each kind."""
    if kind == "textgrid":
        return grid_changed(rng)
    if kind == "head":
        return head_changed(content, rng), suffix(kind)
    if kind == "c3d fields":
        return c3d_changed(rng), suffix(kind)
    if rng.random() < 0.1:
        return cut_or_grown(content, rng), suffix(kind)
    ways = {
        "livelink": table_changed,
        "table": table_changed,
        "openface": table_changed,
        "npz": npz_changed,
        "beat": json_changed,
    }
    return ways.get(kind, words_changed)(content, rng), suffix(kind)


def cut_or_grown(content, rng):
    place = int(rng.integers(len(content)))
    return content[:place] if rng.random() < 0.5 else content[:place] + bytes(rng.integers(0, 256, 20).tolist()) + content[place:]


def table_changed(content, rng):
    rows = [line.split(",") for line in content.decode().splitlines()]
    row, column = int(rng.integers(len(rows))), int(rng.integers(len(rows[0])))
    if rng.random() < 0.3:
        row = 0
    what = rng.integers(9)
    if what < 3:
        rows[row][column % len(rows[row])] = str(rng.choice(CELLS))
    elif what == 3:
        rows[max(row, 1)][0] = str(rng.choice(CODES))
    elif what == 4:
        del rows[row][column]
    elif what == 5:
        rows.insert(row, list(rows[int(rng.integers(len(rows)))]))
    elif what == 6:
        rows[row][column] = rows[row][(column + 1) % len(rows[row])]
    elif what == 7:
        rows = [rows[0], *([f"{cell}00" if k == column else cell for k, cell in enumerate(r)] for r in rows[1:])]
    else:
        del rows[row]
    sign = str(rng.choice([",", ",", ",", ";", "\t", " "]))
    ending = str(rng.choice(["\n", "\n", "\r\n", "\r", "\n\n"]))
    return ending.join(sign.join(cells) for cells in rows).encode(str(rng.choice(ENCODINGS)))


def npz_changed(content, rng):
    if rng.random() < 0.4:
        return words_changed(content, rng)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = str(rng.choice(sorted(members)))
    array = np.load(io.BytesIO(members[name]))
    real = array if array.dtype.kind == "f" else np.ones((2, 3))
    odd = [array.T, array[None], array.ravel(), np.atleast_1d(array)[..., :0], np.array(array.dtype.type()), array.astype("U")]
    odd += [np.full(array.shape, np.nan), np.full(array.shape, 1e308), real.astype("c16"), real.astype("f8").byteswap()]
    odd += [np.array([["a"]]), np.arange(7)]
    if rng.random() < 0.7:
        saved = io.BytesIO()
        np.save(saved, odd[rng.integers(len(odd))])
        members[name] = saved.getvalue()
    elif rng.random() < 0.5:
        members[name] = members[name].replace(b"'shape': (", str(rng.choice(SHAPES)).encode())
    else:
        del members[name]
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED if rng.random() < 0.5 else zipfile.ZIP_STORED) as archive:
        for key, value in members.items():
            archive.writestr(key, value)
    return made.getvalue()


def json_changed(content, rng):
    document = json.loads(content)
    places = [*places_of(document), *[(document, "names"), (document, "frames")] * 40]
    holder, key = places[rng.integers(len(places))]
    holder[key] = ODD[rng.integers(len(ODD))]
    return json.dumps(document).encode()


def words_changed(content, rng):
    """A field of the header (mostly) set to a number that fields do not usually have."""
    made = bytearray(content)
    reach = len(made) if rng.random() < 0.2 else min(len(made), 2048)
    place = int(rng.integers(max(1, reach - 8)))
    kind = str(rng.choice(["<B", "<H", "<I", "<f"]))
    value = (
        rng.choice([0.0, -1.0, 1e30, np.nan, np.inf])
        if kind == "<f"
        else int(rng.choice(NUMBERS)) % (1 << 8 * struct.calcsize(kind))
    )
    struct.pack_into(kind, made, place, value)
    return bytes(made)


class TooSlow(BaseException):
    """Not to be caught by what is tried."""


def too_slow(*_):
    raise TooSlow


def tried(kind, content, path):
    """Whether a file was read; AssertionError for what must not be."""
    path.write_bytes(content)
    try:
        with np.errstate(all="ignore"):
            require_right(kind, path)
    except FacesynthError as error:
        assert "\n" not in str(error), str(error)
        assert len(str(error)) < MOST_LETTERS + len(str(path)), str(error)[:2000]
        return False
    return True


def require_right(kind, path):
    """AssertionError where what is read is none of its kind."""
    if kind == "textgrid":
        assert np.isfinite(read_labelled(path, 1.0).phones.ends_s).all()
        return
    if kind == "head":
        assert np.isfinite(load_own_head(path).rest_mm).all()
        return
    reading = read(path, fps=None if kind in ("livelink", "openface") else 30.0)
    motion = reading.motion
    assert motion.frames.shape == (len(motion), motion.layout.channels), motion.frames.shape
    assert not np.isinf(motion.frames).any()
    assert 0 < motion.fps < 100000, motion.fps
    assert all("\n" not in remark for remark in reading.remarks)


def main(folder, trials, kinds):
    signal.signal(signal.SIGALRM, too_slow)
    told = {}
    for kind in kinds:
        content, rng = whole(kind, folder), np.random.default_rng(trials)
        for one in content if isinstance(content, list) else [content]:
            assert tried(kind, one, folder / f"changed.{suffix(kind)}"), kind
        now = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (now + MOST_BYTES, resource.RLIM_INFINITY))
        facts = {"read": 0, "refused": 0, "slowest_s": 0.0, "failed": []}
        for trial in range(trials):
            odd, ending = changed(kind, content, rng)
            begun = time.process_time()
            signal.setitimer(signal.ITIMER_REAL, 6 * MOST_S)  # a machine may be busy; processor time is looked at below
            try:
                facts["read" if tried(kind, odd, folder / f"changed.{ending}") else "refused"] += 1
            except (Exception, TooSlow) as error:
                facts["failed"].append(f"trial {trial}: {type(error).__name__}: {error}"[:300])
            signal.setitimer(signal.ITIMER_REAL, 0)
            facts["slowest_s"] = max(facts["slowest_s"], time.process_time() - begun)
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        (folder / "channels.txt").unlink(missing_ok=True)
        told[kind] = facts
    print(json.dumps(told))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
