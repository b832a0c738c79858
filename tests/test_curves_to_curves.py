"""Curves under names of their own: imported, learned from, and spoken as curves again."""

import csv
import json

import numpy as np
import pytest
from click.testing import CliRunner
from corpora import tiny_utterances
from own_heads import write_mask

from facesynth.cli import cli
from facesynth.corpus import Corpus
from facesynth.corpus.motion_files import load_motion
from facesynth.face.files.livelink import LiveLinkTake, read_livelink, take_of, write_livelink
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid

NAMES = ("L_mouth_open", "lip_round", "brow up")
MAPPING = """
channels:
  L_mouth_open: {from: jawOpen, gain: 2.0, limit: [0, 2]}
  lip_round: mouthPucker
"""


def run(*arguments):
    done = CliRunner().invoke(cli, list(map(str, arguments)))
    assert done.exit_code == 0, done.output + repr(done.exception)
    return done.stdout


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A model that learned from twelve takes of three curves, through the commands that a person would give."""
    folder = tmp_path_factory.mktemp("curves")
    takes = folder / "takes"
    takes.mkdir()
    for record, speech, motion in tiny_utterances(12):
        lower = motion.points[:, list(motion.layout.names).index("lip_lower"), 1]
        opening = (lower.max() - lower) / 6
        weights = np.stack([opening, 0.5 + 0.4 * np.sin(opening), 0 * opening + 0.1], axis=1)
        np.savez(takes / f"{record.id}.npz", weights=weights[:: round(motion.fps / 60)].astype(np.float32), fps=60.0)
        save_wav(takes / f"{record.id}.wav", speech.audio, speech.sample_rate)
        write_textgrid(takes / f"{record.id}.TextGrid", speech.phones, ())
    (takes / "channels.txt").write_text("\n".join(NAMES), encoding="utf-8")
    assert "added 12" in run("corpus", "add", folder / "actor", takes, "--jobs", 1)
    run("train", "efase", folder / "actor", "-o", folder / "model.safetensors")
    return folder


def speech_of(folder):
    name = sorted((folder / "takes").glob("*.wav"))[0]
    return name, name.with_suffix(".TextGrid")


def test_curves_are_spoken_as_curves(model):
    sound, phones = speech_of(model)
    out = model / "out.csv"
    run("speak", model / "model.safetensors", sound, "--phones", phones, "--fps", 60, "-o", out, "-o", model / "out.npz")
    with open(out, encoding="utf-8", newline="") as file:
        assert next(csv.reader(file)) == ["time_s", *NAMES]
    layout = Corpus.open(model / "actor").layout
    motion, _ = load_motion(out, layout, 60)
    assert motion.frames[:, 0].max() > 1.2, "curves that go beyond 1 are not cut"
    assert np.abs(motion.frames[:, 2] - 0.1).max() < 0.02
    with np.load(model / "out.npz") as stored:
        assert tuple(stored["names"]) == NAMES


def test_curves_of_other_names_are_shown_with_a_mapping_only(model, rig):
    sound, phones = speech_of(model)
    refused = CliRunner().invoke(
        cli, ["speak", str(model / "model.safetensors"), str(sound), "--phones", str(phones), "-o", str(model / "no.glb")]
    )
    assert "give a mapping file (--mapping)" in str(refused.exception)
    (model / "map.yaml").write_text(MAPPING, encoding="utf-8")
    options = ["--phones", phones, "--mapping", model / "map.yaml", "--fps", 60]
    run("speak", model / "model.safetensors", sound, *options, "-o", model / "shown.csv", "-o", model / "plain.csv")
    take = read_livelink(model / "shown.csv", fps=60)
    run("speak", model / "model.safetensors", sound, "--phones", phones, "--fps", 60, "-o", model / "own.csv")
    own, _ = load_motion(model / "own.csv", Corpus.open(model / "actor").layout, 60)
    jaw = take.animation().weight("jawOpen")
    np.testing.assert_allclose(jaw, np.clip(own.frames[:, 0] / 2, 0, 1), atol=1e-3)


def test_a_head_of_ones_own_speaks(model, tmp_path, rig):
    head = write_mask(tmp_path / "head.glb", names=("L_mouth_open", "lip_round"))
    (tmp_path / "map.yaml").write_text(MAPPING, encoding="utf-8")
    sound, phones = speech_of(model)
    options = ["--phones", phones, "--rig", head, "--mapping", tmp_path / "map.yaml", "--size", "64x64", "--fps", 25]
    outputs = [tmp_path / name for name in ("a.mp4", "a.glb", "a.csv", "a.npz", "a.bvh")]
    run("speak", model / "model.safetensors", sound, *options, *(part for out in outputs for part in ("-o", out)))
    assert all(out.stat().st_size > 500 for out in outputs)
    table = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True)
    assert table.dtype.names == ("time_s", "L_mouth_open", "lip_round")
    assert 0.2 < table["L_mouth_open"].max() <= 1.0 + 1e-6


def take(count=130):
    """A take whose eyes look each their own way and roll, as the app's do."""
    rng = np.random.default_rng(0)
    return np.concatenate([rng.random((count, 52)), rng.normal(0, 0.2, (count, 9))], axis=1).astype(np.float32)


def test_our_own_live_link_comes_back_exactly(tmp_path):
    """Written, read and written again not a byte differs; imported as a recording it keeps all that the format holds."""
    from facesynth.corpus.importers.livelink import read_livelink_motion
    from facesynth.face.animation import FaceAnimation
    from facesynth.face.rig.arkit import gaze_of
    from facesynth.motion.arkit_names import ARKIT_NAMES
    from facesynth.motion.timecode import timecode

    values = take()
    first = LiveLinkTake(tuple(timecode(k / 60, 60) for k in range(len(values))), values.astype(np.float64), 60.0)
    write_livelink(tmp_path / "a.csv", first)
    write_livelink(tmp_path / "again.csv", read_livelink(tmp_path / "a.csv"))
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "a.csv").read_bytes()
    motion = read_livelink_motion(tmp_path / "a.csv").motion
    assert motion.fps == 60
    np.testing.assert_allclose(
        motion.frames[:, :52], values[:, :52], atol=1e-10, err_msg="ten decimals are what the format keeps"
    )
    np.testing.assert_allclose(motion.frames[:, 52:], values[:, 55:], atol=1e-7, err_msg="both eyes, with their rolls")
    weights = motion.frames[:, :52]
    assert gaze_of(weights).shape == (len(values), 2)
    back = take_of(FaceAnimation(ARKIT_NAMES, weights, motion.head, motion.eyes[:, 1:], np.zeros(len(values)), 60), motion)
    assert back.timecodes == first.timecodes
    np.testing.assert_allclose(back.values[:, :52], values[:, :52], atol=1e-10)
    np.testing.assert_allclose(back.values[:, 52:], values[:, 52:], atol=2e-7)


def test_real_live_link_takes_come_back_to_the_byte_and_teach_eyes_but_no_speech(recordings, tmp_path):
    from facesynth.corpus.importers.convert import convert
    from facesynth.corpus.importers.formats import read

    for path in sorted(recordings("livelink").glob("*.csv")):
        there = read_livelink(path)
        write_livelink(tmp_path / path.name, there)
        assert (tmp_path / path.name).read_text(encoding="utf-8") == path.read_text(encoding="utf-8").replace("\r\n", "\n")
        motion = read(path).motion
        np.testing.assert_allclose(motion.frames[:, :52], np.clip(there.values[:, :52], 0, 1), atol=1e-7)
        np.testing.assert_allclose(motion.frames[:, 52:], there.values[:, 55:], atol=1e-7)
    report = convert([recordings("livelink")], tmp_path / "plain")
    assert len(report.converted) == 4
    shut = [read(path).motion.eyes[:, 0].min() for path in sorted(recordings("livelink").glob("*.csv"))]
    assert min(shut) < 0.5, "somebody blinks"
    run("corpus", "add", tmp_path / "c", recordings("livelink"), "--jobs", 1)
    corpus = Corpus.open(tmp_path / "c")
    assert (len(corpus.records), len(corpus)) == (4, 0)
    assert all("no sound" in record.reason for record in corpus.records)
    told = json.loads(run("corpus", "stats", tmp_path / "c", "--add", 0, "--json"))["eyes"]
    assert (told["recordings"], told["silent"]) == (4, 4)
    assert told["blinks"] > 15
    assert 30 < told["blink_ms"] < 400, "the time for which an eye is more than half shut"
    assert 0.5 < told["gaze_deg"][0] < 20
    refused = CliRunner().invoke(cli, ["train", "efase", str(tmp_path / "c"), "-o", str(tmp_path / "m.safetensors")])
    assert "there is no sound" in str(refused.exception)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "most_rmse", "least_correlation"), [("ridge", 0.027, 0.6), ("efase", 0.033, 0.5)])
def test_facegood_comes_in_and_out_as_curves(recordings, tmp_path, method, most_rmse, least_correlation):
    """Mandarin, 116 curves, no transcript: phones by ear, a model, and curves of a take that it did not see."""
    source = recordings("facegood")
    added = json.loads(run("corpus", "add", tmp_path / "c", source, "--jobs", 1, "--json"))["added"]
    assert len(added) == 4
    corpus = Corpus.open(tmp_path / "c")
    corpus.update(type(corpus.records[0])(**{**corpus.record(added[0]).__dict__, "split": "test"}))
    run("train", method, tmp_path / "c", "--split", "train", "-o", tmp_path / "m.safetensors")
    run("speak", tmp_path / "m.safetensors", source / f"{added[0]}.wav", "-o", tmp_path / "o.csv")
    told, _ = load_motion(tmp_path / "o.csv", corpus.layout, 30)
    truth = corpus[added[0]].motion
    count = min(len(told), len(truth))
    error = np.sqrt(np.square(told.frames[:count] - truth.frames[:count]).mean())
    assert error < most_rmse
    jaw = int(np.argmax(truth.frames.std(axis=0)))
    assert np.corrcoef(told.frames[:count, jaw], truth.frames[:count, jaw])[0, 1] > least_correlation


@pytest.mark.slow
def test_beat2_gives_head_and_eyes_with_speech(recordings, tmp_path):
    """Phones by ear go with what is seen: the jaw opens in vowels, the head turns more where somebody speaks."""
    run("corpus", "add", tmp_path / "c", recordings("beat2_scott"), "--jobs", 1)
    utterance = next(iter(Corpus.open(tmp_path / "c")))
    motion, phones = utterance.motion, utterance.speech.phones
    assert motion.duration_s == pytest.approx(45, abs=0.2)
    assert len(phones) > 150, "45 s of talk"
    jaw = motion.frames[:, 0]
    bounds = phones.frame_bounds(motion.fps)
    spans = list(zip(phones.labels, bounds[:-1], bounds[1:], strict=True))
    wide, shut = (
        np.concatenate([jaw[first:stop] for label, first, stop in spans if label in labels])
        for labels in (("aa", "ae", "ah", "ay", "ao", "aw"), ("p", "b", "m"))
    )
    assert np.median(wide) > 2 * np.median(shut)
    assert np.isfinite(motion.head).all()
    turning = np.abs(np.diff(motion.head[:, :3], axis=0)).sum(axis=1)
    silent = np.concatenate([np.arange(first, stop) for label, first, stop in spans if label == "pau"])
    speaking = np.setdiff1d(np.arange(len(turning)), silent)
    assert np.ptp(motion.head[:, :3], axis=0).max() > 0.1, "the head turns"
    assert turning[speaking].mean() > turning[silent[silent < len(turning)]].mean(), "more while speaking"
    assert np.ptp(motion.eyes[:, 1:], axis=0).max() > 0.03, "the eyes move"
    assert json.loads(run("corpus", "stats", tmp_path / "c", "--add", 0, "--json"))["eyes"]["recordings"] == 1
