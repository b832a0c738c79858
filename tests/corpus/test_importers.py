import resource
import struct
import zipfile
from contextlib import suppress

import numpy as np
import pytest
import scipy.io
from click.testing import CliRunner
from clips import write_video
from mocap_files import write_c3d

from facesynth.cli.corpus import corpus_group
from facesynth.corpus import Corpus
from facesynth.corpus.add.add import add
from facesynth.corpus.add.recordings import find_recordings
from facesynth.corpus.importers.convert import convert
from facesynth.corpus.importers.description import Description, Written, turned
from facesynth.corpus.importers.formats import FORMATS, Format, read
from facesynth.corpus.importers.reading import Reading, motion_of_arrays
from facesynth.corpus.importers.video import corpus_from_video
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.speech.audio import save_wav

LAYOUT = Layout("markers", ("chin", "lip"), {"jaw": (0,), "mouth": (1,)})


def hum(path, seconds=1.0):
    save_wav(path, (0.2 * np.sin(np.arange(int(16000 * seconds)) * 0.1)).astype(np.float32), 16000)


def livelink_text(frames=120, head=0.1):
    from facesynth.motion.livelink import ANGLES, COUNT, TIMECODE

    names = ["EyeBlinkLeft", "EyeBlinkRight", "JawOpen"]
    rows = [",".join([TIMECODE, COUNT, *names, *ANGLES])]
    for t in range(frames):
        weights = [0.25, 0.75, t / frames]
        angles = [head, -0.2, 0.05, 0.3, -0.1, 0.0, 0.1, -0.3, 0.0]
        cells = [f"{value:.10f}" for value in [*weights, *angles]]
        rows.append(f"10:00:{t // 60:02d}:{t % 60:02d}.000,61," + ",".join(cells))
    return "\n".join(rows) + "\n"


def test_c3d_with_gaps_odd_units_and_109_markers(tmp_path):
    pytest.importorskip("c3d")
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (40, 109, 3)).astype(np.float32)
    points[5:9, 3] = np.nan
    points[:, 100] = np.nan
    reading = read(write_c3d(tmp_path / "täke 1.c3d", points, unit="dm"))
    assert reading.motion.fps == 120
    assert len(reading.motion.layout.names) == 109
    assert np.array_equal(np.isnan(reading.motion.points), np.isnan(points))
    truth = 100 * points.astype(np.float64)
    assert np.nanmax(np.abs(reading.motion.points - truth)) <= np.spacing(np.float32(64)), "within one step of float32 at 100 mm"
    assert reading.sound is None


def test_c3d_by_layout_with_other_axes_and_sound(tmp_path):
    pytest.importorskip("c3d")
    points = np.random.default_rng(1).uniform(-100, 100, (60, 3, 3)).astype(np.float32)
    sound = np.sin(np.arange(60 * 200) * 0.05)
    path = write_c3d(tmp_path / "a.c3d", points, labels=["lip", "nose", "chin"], sound=sound)
    reading = read(path, LAYOUT, written=Written(axes="x,z,-y"))
    assert reading.motion.layout == LAYOUT
    assert np.array_equal(reading.motion.points[:, 0], points[:, 2][:, [0, 2, 1]] * np.float32([1, 1, -1]))
    assert "1 markers" in reading.remarks[0]
    assert reading.sound.sample_rate == 24000
    assert np.corrcoef(reading.sound.audio, sound)[0, 1] > 0.9999
    with pytest.raises(FacesynthError, match="unknown marker 'brow'"):
        read(path, Layout("markers", ("brow",)))
    with pytest.raises(FacesynthError, match="in 'furlong'"):
        read(write_c3d(tmp_path / "b.c3d", points, unit="furlong"))
    for axes in ("x,y", "x,x,z", "a,b,c", ""):
        with pytest.raises(FacesynthError, match="three different signed letters"):
            turned(np.zeros((1, 1, 3)), axes)


def test_livelink_gives_weights_head_and_eyes(tmp_path):
    (tmp_path / "take.csv").write_text(livelink_text(), encoding="utf-8")
    motion = read(tmp_path / "take.csv").motion
    assert motion.layout.names[:3] == ("eyeBlinkLeft", "eyeBlinkRight", "jawOpen")
    assert motion.layout.names[3:] == tuple(f"{eye}Eye{turn}" for eye in ("left", "right") for turn in ("Yaw", "Pitch", "Roll"))
    np.testing.assert_allclose(motion.frames[:, 3:], np.tile([0.3, -0.1, 0.0, 0.1, -0.3, 0.0], (120, 1)), atol=1e-7)
    assert motion.fps == pytest.approx(60)
    assert np.allclose(motion.frames[:, 2], np.arange(120) / 120)
    assert np.allclose(motion.eyes[:, 0], 0.5)
    assert np.allclose(motion.eyes[:, 1:], [-0.2, 0.2])
    assert motion.head[0, 1] < 0, "positive yaw turns to the performer's right"


def test_curves_with_a_list_of_names_become_a_corpus(tmp_path):
    weights = np.random.default_rng(2).uniform(0, 1, (30, 4)).astype(np.float32)
    source = tmp_path / "source"
    source.mkdir()
    np.savez(source / "take.npz", weights=weights, fps=30)
    (source / "channels.txt").write_text("jaw_open\nlip_up\nlip_down\nsmile\n", encoding="utf-8")
    hum(source / "take.wav")
    (source / "take.lab").write_text("0.4 pau\n0.7 aa\n1.0 pau\n", encoding="utf-8")
    run = CliRunner().invoke
    made = run(corpus_group, ["convert", str(source), "-o", str(tmp_path / "out")])
    assert made.exit_code == 0, made.output
    args = ["new", str(tmp_path / "c"), "--performer", "A", "--layout", str(tmp_path / "out" / "layout.yaml"), "--fps", "30"]
    assert run(corpus_group, args).exit_code == 0
    files = [tmp_path / "out" / "take.npz", source / "take.wav", source / "take.lab"]
    done = run(corpus_group, ["add", str(tmp_path / "c"), *map(str, files)])
    assert "added 1" in done.output, done.output
    utterance = Corpus.open(tmp_path / "c")["take"]
    assert utterance.motion.layout.names == ("jaw_open", "lip_up", "lip_down", "smile")
    assert np.array_equal(utterance.motion.frames, weights)


@pytest.mark.parametrize("kind", ["npz", "mat", "csv"])
def test_any_table_with_a_layout(tmp_path, kind):
    points = np.random.default_rng(3).uniform(-50, 50, (20, 2, 3))
    path = tmp_path / f"a.{kind}"
    if kind == "npz":
        np.savez(path, data=points, rate=250)
    elif kind == "mat":
        scipy.io.savemat(path, {"Signal": points, "SRate": 250.0})
    else:
        header = "chin.x,chin.y,chin.z,lip.x,lip.y,lip.z"
        np.savetxt(path, points.reshape(20, 6), delimiter=",", header=header, comments="", fmt="%.6f")
    motion = read(path, LAYOUT, fps=250).motion
    assert motion.fps == 250
    assert np.abs(motion.points - points).max() < 1e-5


def test_curves_that_name_themselves_need_no_layout(tmp_path):
    values = np.random.default_rng(5).uniform(-1, 2, (50, 2)).astype(np.float32)
    from facesynth.face.files.curves import write_curves

    write_curves(tmp_path / "a.csv", ("jaw", "brow up"), values, 60.0)
    np.savez(tmp_path / "b.npz", names=np.array(["jaw", "brow up"]), weights=values, fps=60.0)
    for name in ("a.csv", "b.npz"):
        motion = read(tmp_path / name).motion
        assert motion.layout == Layout("curves", ("jaw", "brow up"))
        assert motion.fps == pytest.approx(60.0, rel=1e-3)
        np.testing.assert_array_equal(motion.frames, values)
    for header in ("chin.x,chin.y,chin.z,lip.x", "0.5,0.25", "a,a"):
        (tmp_path / "c.csv").write_text(f"{header}\n" + ",".join("1" for _ in header.split(",")) + "\n")
        with pytest.raises(FacesynthError, match="does not name its channels"):
            read(tmp_path / "c.csv", fps=30)
    (tmp_path / "d.csv").write_text("a,b\n1,2\n")
    with pytest.raises(FacesynthError, match="does not state its rate"):
        read(tmp_path / "d.csv")


def test_a_new_format_is_a_line_of_the_table(tmp_path, monkeypatch):
    """What reads one file of it makes it known to `corpus add`, to its messages and to `corpus convert`."""

    def toyface(path, asked):
        values = np.array(path.read_text(encoding="utf-8").split(), float)[:, None]
        return Reading(motion_of_arrays(path, values, asked.fps or 30, Layout("curves", ("jawOpen",) * int(values.max()))))

    with pytest.raises(FacesynthError, match=r"no recording to make one from .*\.toyface is neither sound, motion \(\.c3d"):
        begin_corpus(tmp_path / "take")
    monkeypatch.setitem(FORMATS, ".toyface", Format(toyface))
    with pytest.raises(FacesynthError, match=r"no sound file of this name beside a\.toyface.*\.npz, \.toyface\) with its sound"):
        begin_corpus(tmp_path / "take")
    save_wav(tmp_path / "take" / "a.wav", np.zeros(16000, np.float32), 16000)
    found, refused = find_recordings([tmp_path / "take"])
    assert (found[0].motion.name, refused) == ("a.toyface", {})
    report = convert([tmp_path / "take"], tmp_path / "out")
    assert (report.converted, report.fps) == (("a",), 30)
    (tmp_path / "take" / "a.toyface").write_text("0 2 0 1", encoding="utf-8")
    with pytest.raises(FacesynthError, match=r"a\.toyface: a layout needs unique names"):
        read(tmp_path / "take" / "a.toyface")


def begin_corpus(take):
    take.mkdir(exist_ok=True)
    (take / "a.toyface").write_text("0 1 0 1", encoding="utf-8")
    return corpus_from_video(take.with_name("c"), [take], {"performer": "A", "emotions": ["neutral"]})


def test_what_does_not_say_enough_says_so(tmp_path):
    np.savez(tmp_path / "a.npz", weights=np.zeros((3, 2)))
    with pytest.raises(FacesynthError, match="does not name its channels"):
        read(tmp_path / "a.npz")
    curves = Layout("curves", ("a", "b"))
    with pytest.raises(FacesynthError, match="no rate"):
        read(tmp_path / "a.npz", curves)
    with pytest.raises(FacesynthError, match=r"\[T, 6\]"):
        read(tmp_path / "a.npz", LAYOUT, fps=30)
    (tmp_path / "a.txt").write_text("x")
    with pytest.raises(FacesynthError, match="none of"):
        read(tmp_path / "a.txt")


def test_other_channels_than_most_are_refused_and_the_rest_converted(tmp_path):
    for name, channels in (("b", "jawOpen\n"), ("c", "jawOpen\n"), ("a", "smile\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "channels.txt").write_text(channels)
        np.savez(tmp_path / name / f"{name}.npz", weights=np.ones((4, 1)), fps=30)
    (tmp_path / "a" / "hurt.npz").write_bytes(b"PK hurt")
    report = convert([tmp_path / "a", tmp_path / "b", tmp_path / "c"], tmp_path / "out")
    assert report.converted == ("b", "c")
    assert set(report.refused) == {"a.npz", "hurt.npz"}
    assert "other channels" in report.refused["a.npz"]


def hurt(content: bytes, trial: int, rng) -> bytes:
    """The content cut off, or with bytes changed, or both."""
    part = bytearray(content[: int(rng.integers(0, len(content)))] if trial % 3 else content)
    for place in rng.integers(0, max(len(part), 1), int(rng.integers(0, 12))) if part else ():
        part[place] = int(rng.integers(256))
    return bytes(part)


def articulography():
    """MVIEW's structs: a sound with phones, and two sensors."""

    def struct(name, rate, signal, phones=None):
        found = np.zeros((1, 1), [(field, object) for field in ("NAME", "SRATE", "SIGNAL", "PHONES")])
        found[0, 0] = (name, float(rate), signal, np.zeros((0, 0)) if phones is None else phones)
        return found[0, 0]

    phone = np.zeros((1, 2), [("LABEL", object), ("OFFS", object)])
    phone[0, 0], phone[0, 1] = ("AA", np.array([[0.0, 0.05]])), ("B", np.array([[0.05, 0.1]]))
    sound = struct("AUDIO", 16000, np.sin(np.arange(1600) * 0.1)[:, None], phone)
    sensors = [struct(name, 100, np.arange(30.0).reshape(10, 3)) for name in ("UL", "LL")]
    parts = [sound, *sensors]
    return np.array([tuple(part) for part in parts], parts[0].dtype).reshape(1, -1)


@pytest.fixture
def whole_files(tmp_path):
    """One good file of each kind, small."""
    write_c3d(tmp_path / "c.c3d", np.ones((12, 2, 3)), labels=["lip", "chin"], sound=np.zeros(12 * 200))
    points = np.random.default_rng(4).uniform(-50, 50, (12, 2, 3))
    np.savez(tmp_path / "t.npz", frames=points, fps=60)
    np.savez_compressed(tmp_path / "z.npz", frames=points, fps=60)
    scipy.io.savemat(tmp_path / "t.mat", {"frames": points, "fps": 60.0}, do_compression=True)
    header = "chin.x,chin.y,chin.z,lip.x,lip.y,lip.z"
    np.savetxt(tmp_path / "t.csv", points.reshape(12, 6), delimiter=",", header=header, comments="")
    (tmp_path / "l.csv").write_text(livelink_text(90), encoding="utf-8")
    scipy.io.savemat(tmp_path / "m.mat", {"take": articulography()}, do_compression=True)
    turns = {name: np.zeros((5, 3), np.float32) for name in ("jaw", "head", "neck", "left_eye", "right_eye")}
    np.savez(tmp_path / "f.npz", fps=30, **turns)
    return sorted(tmp_path.glob("*.*"))


OWN_LAYOUT = "lfm"
"""Files that say themselves what their channels are."""


def fuzz(whole_files, tmp_path, trials):
    rng = np.random.default_rng(11)
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for path in whole_files:
        assert len(read(path, None if path.stem in OWN_LAYOUT else LAYOUT, fps=60).motion) > 0
        target = tmp_path / f"hurt{path.suffix}"
        content = path.read_bytes()
        for trial in range(trials):
            target.write_bytes(hurt(content, trial, rng))
            with suppress(FacesynthError):
                read(target, None if path.stem in OWN_LAYOUT else LAYOUT, fps=60)
    grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb) / 1024
    assert grown_mb < 400, "a damaged file of some kilobytes must not take memory by what it claims"


def test_an_archive_that_would_unpack_to_gigabytes_is_refused_unread(tmp_path, monkeypatch):
    monkeypatch.setattr("facesynth.inference.npz.LARGEST_BYTES", 2**27)
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("frames.npy", "w", force_zip64=True) as entry:
        for _ in range(12):
            entry.write(bytes(2**24))
    assert path.stat().st_size < 2**20
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(FacesynthError, match=r"would unpack to 0\.2 GB"):
        read(path, LAYOUT, fps=60)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 100_000


def fuzz_video(tmp_path, trials):
    """What a player would have to decode: whole, cut off, and with bytes changed."""
    from facesynth.capture.video import open_video
    from facesynth.speech.audio import load_audio

    rng = np.random.default_rng(12)
    pictures = [np.full((48, 64, 3), 15 * number + 20, np.uint8) for number in range(12)]
    content = write_video(tmp_path / "whole.mp4", pictures, sound_s=0.5).read_bytes()
    target = tmp_path / "hurt.mp4"
    for trial in range(trials):
        target.write_bytes(hurt(content, trial, rng))
        with suppress(FacesynthError), open_video(target) as video:
            for _, picture in video.images:
                assert picture.dtype == np.uint8
        with suppress(FacesynthError):
            load_audio(target)


def test_damaged_videos_never_end_in_a_traceback(tmp_path):
    fuzz_video(tmp_path, 20)


@pytest.mark.slow
def test_five_hundred_damaged_videos(tmp_path):
    fuzz_video(tmp_path, 500)


def test_of_a_folder_what_is_whole_is_converted_and_the_rest_has_its_reason(whole_files, tmp_path):
    folder = tmp_path / "mixed"
    folder.mkdir()
    np.savez(folder / "good.npz", frames=np.ones((5, 6)), fps=60)
    for path in whole_files:
        (folder / f"empty_{path.name}").write_bytes(b"")
        (folder / f"cut_{path.name}").write_bytes(path.read_bytes()[: path.stat().st_size // 3])
        other = ".c3d" if path.suffix != ".c3d" else ".npz"
        (folder / f"called_{path.stem}{other}").write_bytes(path.read_bytes())
    report = convert([folder], tmp_path / "out", description=Description(LAYOUT))
    assert "good" in report.converted
    others = {path.name for path in folder.iterdir()} - {"good.npz"}
    cut_rows = {"cut_t.csv", "cut_l.csv"}  # a table that was cut off between two lines is a shorter table
    assert others - set(report.refused) <= cut_rows
    assert all(len(reason) > 20 and "\n" not in reason for reason in report.refused.values())


def test_damaged_files_never_end_in_a_traceback(whole_files, tmp_path):
    with np.errstate(all="ignore"):
        fuzz(whole_files, tmp_path, 20)


@pytest.mark.slow
def test_five_hundred_damaged_files_of_each_kind(whole_files, tmp_path):
    with np.errstate(all="ignore"):
        fuzz(whole_files, tmp_path, 500)


@pytest.mark.parametrize("content", [b"", b"no capture", b"\x02\x51" + bytes(600), b"\x02\x50" + bytes(600)])
def test_what_is_no_c3d(tmp_path, content):
    pytest.importorskip("c3d")
    (tmp_path / "a.c3d").write_bytes(content)
    with pytest.raises(FacesynthError, match=r"a\.c3d"):
        read(tmp_path / "a.c3d")


def test_a_c3d_that_is_cut_off(tmp_path):
    pytest.importorskip("c3d")
    whole = write_c3d(tmp_path / "a.c3d", np.ones((30, 4, 3), np.float32)).read_bytes()
    for share in (0.2, 0.5, 0.9):
        (tmp_path / "b.c3d").write_bytes(whole[: int(share * len(whole))])
        with suppress(FacesynthError):
            read(tmp_path / "b.c3d")
    claims_much = bytearray(whole)
    claims_much[6:10] = struct.pack("<HH", 1, 65535)
    (tmp_path / "c.c3d").write_bytes(bytes(claims_much))
    with suppress(FacesynthError):
        read(tmp_path / "c.c3d")


def test_real_takes(recordings, tmp_path):
    facegood = convert([recordings("facegood")], tmp_path / "facegood")
    assert len(facegood.converted) == 4
    assert read(recordings("facegood") / "1114_2_01.npz").motion.frames.shape == (3295, 116)
    scott = read(recordings("beat2_scott") / "2_scott_0_1_1_first45s.npz").motion
    assert np.isfinite(scott.head).all()
    assert len(scott) / scott.fps == pytest.approx(45)
    take = read(recordings("livelink") / "MySlate_161_iPhone_cal.csv").motion
    assert len(take.layout.names) == 58
    assert take.eyes[:, 0].min() < 0.5, "somebody blinks"


def test_real_articulography_comes_with_sound_phones_and_words(recordings, tmp_path):
    report = convert([recordings("haskins_ema")], tmp_path / "ema")
    assert len(report.converted) == 2
    reading = read(recordings("haskins_ema") / "F01_B01_S01_R01_N.mat")
    corpus = Corpus.create(tmp_path / "c", performer="F01", layout=reading.motion.layout, fps=100, emotions=["neutral"])
    assert len(add(corpus, [tmp_path / "ema"]).added) == 2
    utterance = corpus["F01_B01_S01_R01_N"]
    assert utterance.speech.phones.labels[:4] == ("pau", "dh", "ah", "b")
    assert utterance.speech.text == "The birch canoe slid on the smooth planks."
    lips = utterance.motion.points[:, utterance.motion.layout.names.index("UL")] - utterance.motion.points[:, 4]
    assert 10 < np.median(lips[:, 1]) < 45, "the upper lip is above the lower one"
