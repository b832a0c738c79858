"""One command from a folder of another system to a corpus."""

import subprocess
from contextlib import suppress

import numpy as np
import pytest
import scipy.io
from click.testing import CliRunner
from corpora import tiny_utterances
from interrupted import COMMAND, contents, killed_and_repeated
from mocap_files import write_c3d
from test_importers import articulography, hum, hurt, livelink_text

from facesynth.cli import cli
from facesynth.corpus import Corpus
from facesynth.corpus.add.add import add
from facesynth.corpus.importers.formats import read
from facesynth.corpus.importers.session import corpus_from_files, survey
from facesynth.corpus.workers import Workers
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import lip_gap
from facesynth.motion.pose import apply_head
from facesynth.speech.audio import load_audio, save_wav
from facesynth.speech.textgrid import write_textgrid

FACE = {
    "forehead_mid": (0, 60, 80), "forehead_l": (30, 55, 70), "forehead_r": (-30, 55, 70), "nose_bridge": (0, 30, 90),
    "brow_l": (30, 40, 75), "brow_r": (-30, 40, 75), "cheek_l": (45, 0, 55), "cheek_r": (-45, 0, 55),
    "upper_lip": (0, -25, 92), "lower_lip": (0, -35, 90), "mouth_l": (25, -30, 75), "mouth_r": (-25, -30, 75),
    "chin": (0, -55, 80), "jaw_l": (30, -60, 55), "jaw_r": (-30, -60, 55), "LBHD": (75, 60, -40), "RBHD": (-75, 60, -40),
    "CHD": (0, 110, 10),
}  # fmt: skip
"""A face of eighteen markers: mm, x to the performer's left, y up, z out of the face."""
LOW = ("lower_lip", "chin", "jaw_l", "jaw_r")
RIGID = ("LBHD", "RBHD", "CHD")


def speaking(seed, count=240, turned=True):
    """[T, K, 3] a face that opens its mouth by up to 12 mm while the head turns; and the opening [T] above the rest."""
    rng = np.random.default_rng(seed)
    rest = np.array(list(FACE.values()), float)
    opening = 12 * np.clip(np.sin(np.arange(count) / 9 + rng.uniform(0, 6)), 0, 1) ** 2
    points = np.tile(rest, (count, 1, 1))
    points[:, [list(FACE).index(name) for name in LOW], 1] -= opening[:, None]
    time = np.arange(count)[:, None] / 100
    head = np.concatenate([0.2 * np.sin(time + rng.uniform(0, 6, 3)), 15 * np.sin(time / 2 + rng.uniform(0, 6, 3))], axis=1)
    rigid = [list(FACE).index(name) for name in RIGID]
    return (apply_head(points, head, rest, rigid) if turned else points.astype(np.float32)), opening


def talk(seconds, rate=16000):
    """Something that can be aligned: a hum that swells."""
    times = np.arange(int(rate * seconds)) / rate
    return (0.3 * np.sin(2 * np.pi * 150 * times) * np.abs(np.sin(3 * times))).astype(np.float32)


def labels(path, seconds):
    path.write_text(f"0.5 pau\n1.0 aa\n1.5 b\n{seconds:.3f} pau\n", encoding="utf-8")


def mocap(folder, names=tuple(FACE), takes=3, turn=lambda points: points):
    """A day's takes in C3D: sound inside the first, beside the others; words beside all."""
    pytest.importorskip("c3d")
    folder.mkdir(exist_ok=True)
    openings = {}
    for take in range(takes):
        points, openings[f"t{take}"] = speaking(take)
        sound = talk(2.0, 24000).astype(float) if take == 0 else None
        write_c3d(folder / f"t{take}.c3d", turn(points).astype(np.float32), labels=list(names), sound=sound)
        if take:
            save_wav(folder / f"t{take}.wav", talk(2.0), 16000)
        labels(folder / f"t{take}.lab", 2.0)
        (folder / f"t{take}.txt").write_text("ab\n")
    return openings


def run(*arguments):
    return CliRunner().invoke(cli, list(map(str, arguments)))


def test_groups_that_a_layout_file_states_are_not_added_to(tmp_path):
    mocap(tmp_path / "session", takes=1)
    lines = f"kind: markers\nnames: [{', '.join(FACE)}]\ngroups: {{jaw: [chin], rigid: [{', '.join(RIGID)}]}}\n"
    (tmp_path / "layout.yaml").write_text(lines)
    done = run("corpus", "add", tmp_path / "actor", tmp_path / "session", "--layout", tmp_path / "layout.yaml", "--jobs", 1)
    assert done.exit_code == 0, done.output
    layout = Corpus.open(tmp_path / "actor").layout
    assert {name: [layout.names[k] for k in members] for name, members in layout.groups.items()} == {
        "jaw": ["chin"],
        "rigid": list(RIGID),
    }


def test_a_folder_of_c3d_becomes_a_corpus_in_one_command(tmp_path):
    openings = mocap(tmp_path / "session")
    done = run("corpus", "add", tmp_path / "actor", tmp_path / "session", "--jobs", 1)
    assert done.exit_code == 0, done.output
    assert "groups of markers told by their names" in done.output
    corpus = Corpus.open(tmp_path / "actor")
    assert (corpus.fps, len(corpus), corpus.performer) == (120, 3, "actor")
    layout = corpus.layout
    assert [layout.names[k] for k in layout.groups["rigid"]] == list(RIGID)
    assert [(layout.names[a], layout.names[b]) for a, b in layout.lip_pairs] == [("upper_lip", "lower_lip")]
    assert layout.groups["jaw"] == tuple(layout.names.index(name) for name in ("chin", "jaw_l", "jaw_r"))
    for name, opening in openings.items():
        motion = corpus[name].motion
        assert np.ptp(motion.head[:, :3], axis=0).max() > 0.1, "the head's motion was taken out"
        gap = lip_gap(motion) - lip_gap(motion).min()
        assert np.abs(gap - opening).max() < 0.3
        assert corpus.record(name).text == "ab"
    assert len(load_audio(corpus.files.audio("t0"))[0]) == 48000, "the sound that was in the file"
    before = contents(corpus.path)
    again = run("corpus", "add", tmp_path / "actor", tmp_path / "session", "--jobs", 1)
    assert again.exit_code == 0, again.output
    assert {name: before[name] for name in before if name[0] != "."} == {
        name: content for name, content in contents(corpus.path).items() if name[0] != "."
    }


def test_the_rest_of_a_face_has_its_lips_shut_and_is_that_of_most(tmp_path):
    mocap(tmp_path / "session")
    names = list(FACE)
    swapped = names.copy()
    swapped[0], swapped[12] = swapped[12], swapped[0]
    write_c3d(tmp_path / "session" / "a_swapped.c3d", speaking(9)[0], labels=swapped)
    layout = survey(sorted((tmp_path / "session").glob("*.c3d"))).layout
    rest = np.reshape(layout.neutral, (-1, 3))[[layout.names.index(name) for name in names]]
    truth = np.array(list(FACE.values()), float)
    distances, wanted = (np.linalg.norm(shape[:, None] - shape[None], axis=2) for shape in (rest, truth))
    assert np.abs(distances - wanted).max() < 1.0


def test_one_odd_file_that_sorts_first_does_not_set_the_layout(tmp_path):
    mocap(tmp_path / "session", takes=2)
    write_c3d(tmp_path / "session" / "a_other.c3d", np.ones((12, 5, 3)), labels=list("abcde"), sound=np.ones(12 * 200) * 0.1)
    done = run("corpus", "convert", tmp_path / "session", "-o", tmp_path / "plain")
    assert "converted 2, not usable 1" in done.output, done.output
    for name in ("t0.wav", "t1.wav", "t0.lab", "t1.lab", "t0.txt"):
        assert (tmp_path / "plain" / name).is_file(), "what lies in or beside the files comes along"
    made = run("corpus", "add", tmp_path / "actor", tmp_path / "session", "--jobs", 1, "--json")
    assert '"t0"' in made.output
    assert "a_other" in made.output
    assert len(Corpus.open(tmp_path / "actor")) == 2


def test_axes_that_the_names_tell_are_found_and_kept_with_the_corpus(tmp_path):
    mocap(tmp_path / "session", turn=lambda points: points[..., [0, 2, 1]] * [1, -1, 1])
    one = sorted((tmp_path / "session").glob("t1.*"))
    done = run("corpus", "add", tmp_path / "actor", *one, "--jobs", 1)
    assert done.exit_code == 0, done.output
    assert "axes taken as x,z,-y" in done.output
    assert "x,z,-y" in (tmp_path / "actor" / "recordings.yaml").read_text(encoding="utf-8")
    assert run("corpus", "add", tmp_path / "actor", tmp_path / "session", "--jobs", 1).exit_code == 0
    corpus = Corpus.open(tmp_path / "actor")
    assert np.abs(corpus["t2"].motion.head[:, :3]).max() < 0.6
    refused = run("corpus", "add", tmp_path / "actor", tmp_path / "session", "--axes", "x,y,z")
    assert "are for a new corpus" in str(refused.exception)


def test_markers_that_are_merely_numbered_are_told_by_how_they_move(tmp_path):
    mocap(tmp_path / "session", names=[f"M{k:03d}" for k in range(len(FACE))])
    layout = survey(sorted((tmp_path / "session").glob("*.c3d"))).layout
    names = list(FACE)
    assert [(names[a], names[b]) for a, b in layout.lip_pairs] == [("upper_lip", "lower_lip")]
    assert not {names[k] for k in layout.groups["rigid"]} & {*LOW, "upper_lip"}
    assert {names[k] for k in layout.groups["jaw"]} == {"chin", "jaw_l", "jaw_r"}


def test_two_processes_give_the_same_corpus_as_one(tmp_path):
    mocap(tmp_path / "session", takes=2)
    motions = sorted((tmp_path / "session").glob("*.c3d"))
    made = []
    for jobs in (1, 2):
        header = {"performer": "A", "emotions": ["neutral"]}
        corpus, _ = corpus_from_files(tmp_path / f"c{jobs}", motions, header, workers=Workers(jobs))
        assert len(add(corpus, [tmp_path / "session"], workers=Workers(jobs)).added) == 2
        made.append({name: content for name, content in contents(corpus.path).items() if name[0] != "."})
    assert made[0] == made[1]


def test_a_take_without_any_sound_says_so(tmp_path):
    mocap(tmp_path / "session")
    (tmp_path / "session" / "t1.wav").unlink()
    done = run("corpus", "add", tmp_path / "actor", tmp_path / "session", "--jobs", 1, "--json")
    assert "there is no sound in t1.c3d and none beside it (t1.wav)" in done.output
    assert len(Corpus.open(tmp_path / "actor")) == 2


def test_live_link_with_sound_beside_it_is_speech_and_without_it_eyes_and_blinks(tmp_path):
    session = tmp_path / "session"
    session.mkdir()
    for name in ("a", "b"):
        (session / f"{name}.csv").write_text(livelink_text(), encoding="utf-8")
    save_wav(session / "a.wav", talk(2.0), 16000)
    labels(session / "a.lab", 2.0)
    done = run("corpus", "add", tmp_path / "actor", session, "--jobs", 1)
    assert done.exit_code == 0, done.output
    assert "b: no speech: there is no sound; kept for eyes and blinks; lay b.wav beside it" in done.output
    corpus = Corpus.open(tmp_path / "actor")
    assert corpus.ids == ("a",)
    assert "kept for eyes and blinks" in corpus.record("b").reason
    assert corpus["a"].motion.layout.kind == "curves"
    told = run("corpus", "stats", tmp_path / "actor", "--add", 0)
    assert "eyes" in told.output, told.output
    save_wav(session / "b.wav", talk(2.0), 16000)
    labels(session / "b.lab", 2.0)
    assert run("corpus", "add", tmp_path / "actor", session, "--jobs", 1).exit_code == 0
    assert Corpus.open(tmp_path / "actor").ids == ("a", "b"), "a sound that comes later makes it speech"


def test_a_corpus_of_eyes_alone_teaches_no_speech_and_says_why(tmp_path):
    (tmp_path / "take.csv").write_text(livelink_text(), encoding="utf-8")
    assert run("corpus", "add", tmp_path / "actor", tmp_path / "take.csv", "--jobs", 1).exit_code == 0
    refused = run("train", "efase", tmp_path / "actor", "-o", tmp_path / "m.safetensors")
    assert isinstance(refused.exception, FacesynthError)
    assert "there is no sound" in str(refused.exception)
    assert not (tmp_path / "m.safetensors").exists()


def test_articulography_brings_its_own_sound_and_phones(tmp_path):
    (tmp_path / "session").mkdir()
    scipy.io.savemat(tmp_path / "session" / "m.mat", {"take": articulography()})
    done = run("corpus", "add", tmp_path / "actor", tmp_path / "session", "--jobs", 1)
    assert done.exit_code == 0, done.output
    utterance = Corpus.open(tmp_path / "actor")["m"]
    assert utterance.speech.phones.labels == ("aa", "b")
    assert utterance.motion.fps == 100


SEMICOLONS = """Zeit;Kinn X;Kinn Y;Kinn Z;Lippe X;Lippe Y;Lippe Z
0,000;1,5;2;3;4;5;6
0,004;1,6;2;3;4;;6
0,008;1,7;2;3;4;5;6
"""
WORDS = """
kind: markers
names: [Kinn, Lippe]
groups: {jaw: [Kinn], mouth: [Lippe]}
files: {delimiter: semicolon, decimal: ",", time: Zeit, unit: cm, axes: "x,z,-y"}
"""


def test_a_table_with_semicolons_and_decimal_commas(tmp_path):
    (tmp_path / "a.csv").write_text(SEMICOLONS, encoding="utf-8")
    (tmp_path / "layout.yaml").write_text(WORDS, encoding="utf-8")
    motion = read(tmp_path / "a.csv").motion
    assert motion.fps == pytest.approx(250)
    assert motion.layout.groups == {"jaw": (0,), "mouth": (1,)}
    np.testing.assert_allclose(motion.points[:, 0], [[15, 30, -20], [16, 30, -20], [17, 30, -20]], atol=1e-5)
    assert np.isnan(motion.points[1, 1]).any()
    hum(tmp_path / "a.wav", 0.5)
    (tmp_path / "layout.yaml").unlink()
    assert read(tmp_path / "a.csv", fps=250).motion.layout.names == ("Kinn", "Lippe"), "it names its points itself"
    with pytest.raises(FacesynthError, match="does not state its rate"):
        read(tmp_path / "a.csv")


@pytest.mark.parametrize("shape", [(40, 14), (40, 2, 7)])
def test_a_layout_file_picks_some_values_of_each_sensor(tmp_path, shape):
    """Two sensors with seven values each, of which three are the place."""
    values = np.random.default_rng(0).normal(size=shape)
    np.savez(tmp_path / "a.npz", frames=values, fps=100.0)
    lines = "kind: markers\nnames: [A, B]\nfiles: {columns: %s}\n"
    (tmp_path / "layout.yaml").write_text(lines % '"1-3,8-10"')
    points = read(tmp_path / "a.npz").motion.points
    np.testing.assert_allclose(points, values.reshape(40, 2, 7)[:, :, :3], rtol=1e-6)
    np.savetxt(tmp_path / "b.csv", values.reshape(40, 14), delimiter=",", fmt="%.9f")
    np.testing.assert_allclose(read(tmp_path / "b.csv", fps=100).motion.points, points, atol=1e-6)
    faults = {'"1-3,13-15"': "only 14", "[1, 2]": r"must have shape \[T, 6\]", '"0-2"': "from 1 on", "[3-1]": "from 1 on"}
    for columns, why in faults.items():
        (tmp_path / "layout.yaml").write_text(lines % columns)
        with pytest.raises(FacesynthError, match=why):
            read(tmp_path / "a.npz")


def test_a_table_of_other_columns_is_told_in_a_line(tmp_path):
    numbers = ",".join(f"0.{k:060d}" for k in range(40))
    (tmp_path / "a.csv").write_text(f"{numbers}\n{numbers}\n")
    (tmp_path / "layout.yaml").write_text("kind: markers\nnames: [chin, lip]\n")
    with pytest.raises(FacesynthError, match="does not name the columns") as told:
        read(tmp_path / "a.csv", fps=250)
    assert len(str(told.value)) < 300


@pytest.mark.parametrize(
    ("kind", "arrays", "said"),
    [
        ("npz", lambda points: {"positions": points, "samplerate": 250}, ""),
        ("mat", lambda points: {"points": points, "fs": 250.0}, ""),
        ("npz", lambda points: {"a": points, "b": points[:1], "c": np.array(250)}, "files: {array: a, rate: c}"),
        ("npz", lambda points: {"points": points}, "files: {rate: 250}"),
        ("mat", lambda points: {"take": {"xyz": points / 10, "fs": 250.0}}, "files: {array: take.xyz, rate: take.fs, unit: cm}"),
        ("mat", lambda points: {"points": points.transpose(1, 2, 0), "fs": 250.0}, ""),
        ("mat", lambda points: {"points": points.transpose(2, 1, 0), "fs": 250.0}, 'files: {order: "axes,points,time"}'),
        ("npz", lambda points: {"points": points.reshape(20, 6).T, "fs": 250}, ""),
        ("npz", lambda points: {"points": points, "names": np.array(["chin", "lip"]), "fs": 250}, None),
    ],
)
def test_what_a_layout_file_can_say(tmp_path, kind, arrays, said):
    points = np.random.default_rng(3).uniform(-50, 50, (20, 2, 3))
    if kind == "npz":
        np.savez(tmp_path / "a.npz", **arrays(points))
    else:
        scipy.io.savemat(tmp_path / "a.mat", arrays(points))
    if said is not None:
        (tmp_path / "layout.yaml").write_text(f"kind: markers\nnames: [chin, lip]\n{said}\n")
    motion = read(tmp_path / f"a.{kind}").motion
    assert motion.fps == 250
    assert motion.layout.names == ("chin", "lip")
    np.testing.assert_allclose(motion.points, points, atol=1e-5)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ("{unit: parsec}", "unknown unit"),
        ("{axes: 'x,x,y'}", "three different signed letters"),
        ("{order: 'time,space'}", "order lists"),
        ("{decimal: ';'}", "decimal is"),
        ("{delimiter: ';;'}", "one sign"),
        ("{arrays: a}", "unknown key under files"),
        ("{array: nothing}", "unknown array"),
    ],
)
def test_what_is_said_wrongly_is_one_clear_error(tmp_path, said, message):
    np.savez(tmp_path / "a.npz", points=np.ones((4, 2, 3)), fs=60)
    (tmp_path / "layout.yaml").write_text(f"kind: markers\nnames: [chin, lip]\nfiles: {said}\n")
    with pytest.raises(FacesynthError, match=message):
        read(tmp_path / "a.npz")


def test_numbers_in_place_of_names_are_taken_in_order(tmp_path):
    (tmp_path / "a.csv").write_text("1,2,3,4,5,6\n1,2,3,4,5,6\n")
    (tmp_path / "layout.yaml").write_text("kind: markers\nnames: [chin, lip]\nfiles: {rate: 60}\n")
    reading = read(tmp_path / "a.csv")
    assert reading.motion.frames[0].tolist() == [1, 2, 3, 4, 5, 6]
    assert "in the layout's order" in reading.remarks[0]


def fuzz_add(tmp_path, trials):
    """Damaged files of each kind through `add`: every one a clear reason, and the good one beside it added."""
    whole = tmp_path / "whole"
    mocap(whole, takes=1)
    scipy.io.savemat(whole / "m.mat", {"take": articulography()}, do_compression=True)
    (whole / "l.csv").write_text(livelink_text(60), encoding="utf-8")
    for record, speech, motion in tiny_utterances(1):
        np.savez(whole / "n.npz", frames=motion.frames, fps=motion.fps, names=np.array(motion.layout.names))
        save_wav(whole / "n.wav", speech.audio, speech.sample_rate)
        write_textgrid(whole / "n.TextGrid", speech.phones, ())
        assert record.id
    rng = np.random.default_rng(5)
    for suffix, stem in ((".c3d", "t0"), (".mat", "m"), (".csv", "l")):
        session = tmp_path / f"session{suffix}"
        session.mkdir()
        content = (whole / f"{stem}{suffix}").read_bytes()
        for trial in range(trials):
            (session / f"hurt{trial:03d}{suffix}").write_bytes(hurt(content, trial, rng))
            labels(session / f"hurt{trial:03d}.lab", 0.1)
        (session / f"good{suffix}").write_bytes(content)
        if stem == "t0":
            labels(session / "good.lab", 2.0)
        header = {"performer": "A", "emotions": ["neutral"]}
        corpus, _ = corpus_from_files(tmp_path / f"c{suffix}", [session / f"good{suffix}"], header)
        report = add(corpus, [session])
        assert "good" in report.added
        assert all(len(reason) > 15 and "\n" not in reason for reason in report.refused.values())
        assert not any("fault of facesynth" in reason for reason in report.refused.values()), report.refused
        assert len(report.added) + len(report.refused) == trials + 1
        with suppress(FacesynthError):
            corpus_from_files(tmp_path / f"d{suffix}", sorted(session.glob(f"hurt*{suffix}")), header)


def test_damaged_files_are_told_and_the_rest_added(tmp_path):
    with np.errstate(all="ignore"):
        fuzz_add(tmp_path, 20)


@pytest.mark.slow
def test_five_hundred_damaged_files_of_each_kind_through_add(tmp_path):
    with np.errstate(all="ignore"):
        fuzz_add(tmp_path, 500)


def test_seven_sensors_at_250_hz_from_arrays_of_other_names(tmp_path):
    session = tmp_path / "session"
    session.mkdir()
    names = ("TD", "TB", "TT", "UL", "LL", "JAW", "NOSE")
    opening = 5 + 5 * np.sin(np.arange(500) / 12)
    points = np.tile(np.arange(21.0).reshape(7, 3), (500, 1, 1))
    points[:, 4, 1] -= opening
    np.savez(session / "a.npz", positions=points.transpose(1, 2, 0) / 10, samplerate=250)
    save_wav(session / "a.wav", talk(2.0), 16000)
    labels(session / "a.lab", 2.0)
    (session / "layout.yaml").write_text(
        f"kind: markers\nnames: [{', '.join(names)}]\nlip_pairs: [[UL, LL]]\nfiles: {{unit: cm, order: 'points,axes,time'}}\n"
    )
    done = run("corpus", "add", tmp_path / "actor", session, "--jobs", 1)
    assert done.exit_code == 0, done.output
    corpus = Corpus.open(tmp_path / "actor")
    assert corpus.fps == 250
    motion = corpus["a"].motion
    assert motion.layout.names == names
    assert motion.layout.groups["tongue"] == (0, 1, 2)
    np.testing.assert_allclose(lip_gap(motion) - lip_gap(motion).min(), opening - opening.min(), atol=1e-4)


@pytest.mark.slow
def test_killed_ten_times_and_run_again_gives_the_same_bytes(tmp_path):
    mocap(tmp_path / "session", takes=6)
    options = [str(tmp_path / "session"), "--performer", "A", "--jobs", "2"]
    killed_and_repeated(lambda target: ["add", str(target), *options], tmp_path, 10, seed=8)


@pytest.mark.slow
def test_two_ray_workers_give_the_same_bytes_as_one_process(tmp_path):
    pytest.importorskip("ray")
    mocap(tmp_path / "session", takes=4)
    made = []
    for engine in ("processes", "ray"):
        options = ["--engine", engine, "--jobs", "1" if engine == "processes" else "2", "--performer", "A"]
        command = [*COMMAND, "add", str(tmp_path / engine), str(tmp_path / "session"), *options]
        subprocess.run(command, check=True, capture_output=True, timeout=1800)
        made.append({name: content for name, content in contents(tmp_path / engine).items() if name[0] != "."})
    assert made[0] == made[1]
