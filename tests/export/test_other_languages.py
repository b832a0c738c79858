"""The same folder from JavaScript: in Node, and in a page of a real browser with the network cut off."""

import base64
import hashlib
import json
import runpy
import shutil
import struct
import subprocess
import sys

import numpy as np
import pytest
from pages import EXAMPLES, a_browser, colours, installed, said_by_node, visited

from facesynth.corpus import Corpus, Record
from facesynth.inference import load
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.lds.method import LDS
from facesynth.speech.audio import save_wav
from facesynth.speech.phone_archive import is_installed

RATE, FPS = 16000, 30


def spoken(loudness, rng):
    """Syllables of noise as loud as told, a fifth of a second each."""
    audio = 0.2 * rng.standard_normal(len(loudness) * RATE // 5) * np.repeat(loudness, RATE // 5)
    seconds = len(audio) / RATE
    track = EmotionTrack.constant("neutral", seconds)
    return Speech(audio.astype(np.float32), RATE, PhoneTrack(("pau",), np.array([seconds])), track)


@pytest.fixture(scope="module")
def talking_head(rig, tmp_path_factory):
    """A system that opens the built-in head's jaw where the sound is loud, and a sound."""
    from facesynth.face.rig.arkit_rig import pose_points
    from facesynth.face.rig.markers import marker_layout, marker_vertices

    rng, home = np.random.default_rng(0), tmp_path_factory.mktemp("head")
    layout = marker_layout(rig)
    corpus = Corpus.create(home / "corpus", performer="Jaw", layout=layout, fps=FPS, emotions=("neutral",), synthetic=True)
    for clip in range(6):
        loudness = rng.uniform(0, 1, 15)
        weights = np.zeros((90, 52))
        weights[:, rig.index("jawOpen")[0]] = 0.5 * np.convolve(np.repeat(loudness, 6), [0.2, 0.5, 0.3], "same")
        weights[:, rig.index("mouthSmileLeft", "mouthSmileRight")] = 0.1 * rng.uniform(0, 1, (90, 1))
        frames = pose_points(rig, marker_vertices(rig, layout), weights).reshape(90, -1)
        corpus.add_utterance(Record(f"c{clip}", sentence=f"c{clip}"), spoken(loudness, rng), Motion(frames, FPS, layout))
    quick = {
        "hears": "periodogram",
        "features": 4,
        "components": 2,
        "rows": 6,
        "lead_ms": 0,
        "deterministic_order": 2,
        "stochastic_order": 2,
    }
    LDS(**quick).fit(corpus).save(home / "lds.safetensors")
    save_wav(home / "speech.wav", spoken(np.array([0, 1, 0.2, 0.8, 0.1, 1, 0]), rng).audio, RATE)
    return home / "lds.safetensors", home / "speech.wav"


def expected(folder, sound):
    """[T, C] the deterministic part, by the runtime."""
    from facesynth.speech.audio import load_audio

    audio, _ = load_audio(sound)
    stream = load(folder).stream(noise=0.0)
    return np.concatenate([stream.push(audio), stream.finish()])


@pytest.mark.slow
def test_node_speaks_as_the_runtime_does(talking_head, tmp_path):
    from facesynth.export.models import export_model

    model, sound = talking_head
    export_model(model, tmp_path / "lds")
    said = said_by_node("speak.mjs", tmp_path / "lds", sound)
    frames = np.array(said["frames"]).reshape(said["count"], said["channels"])
    assert said["fps"] == FPS
    assert np.abs(frames - expected(tmp_path / "lds", sound)).max() < 1e-2  # mm


@pytest.fixture(scope="module")
def default_lds_file(small_corpus, tmp_path_factory):
    """A system that hears as systems do by default."""
    if not is_installed():
        pytest.skip("the weights that phones are heard with are not installed")
    path = tmp_path_factory.mktemp("models") / "default.safetensors"
    LDS(deterministic_order=2, stochastic_order=2).fit(small_corpus).save(path)
    return path


def wav(channels=1, bits=16, kind=1, samples=4000, rate=RATE, cut=0):
    """A file of noise, written by hand."""
    width = channels * bits // 8
    head = struct.pack("<HHIIHH", kind, channels, rate, rate * width, width, bits)
    data = np.random.default_rng(0).integers(0, 256, samples * width, np.uint8).tobytes()
    parts = b"".join(name + struct.pack("<I", len(c)) + c for name, c in ((b"fmt ", head), (b"data", data)))
    content = b"RIFF" + struct.pack("<I", 4 + len(parts)) + b"WAVE" + parts
    return content[: len(content) - cut]


def edited(folder, name, change):
    (folder / name).write_bytes(change((folder / name).read_bytes()))


WRONG = {
    "manifest": (lambda f: edited(f, "manifest.json", lambda c: c.replace(b"CC0-1.0", b"MIT")), wav(), "was changed after"),
    "fps": (lambda f: edited(f, "manifest.json", lambda c: c.replace(b'"fps": 60', b'"fps": 30')), wav(), "was changed after"),
    "graph": (
        lambda f: edited(f, "rollout.onnx", lambda c: c[:-1] + bytes([c[-1] ^ 1])),
        wav(),
        "rollout.onnx does not have the hash",
    ),
    "float": (None, wav(bits=32, kind=3), "32 bits a sample in coding 3"),
    "bytes": (None, wav(bits=8), "8 bits a sample"),
    "rate": (None, wav(rate=44100), "44100 Hz; wanted 16000"),
    "empty": (None, wav(samples=0), "no samples"),
    "cut": (None, wav(cut=100), "truncated"),
    "header": (None, wav()[:30], "truncated"),
    "text": (None, b"speech, but no sound", "no WAV file"),
}


def test_node_refuses_what_the_runtime_refuses(lds_file, exported, tmp_path):
    here, node = installed("node"), shutil.which("node")
    said = {}
    for name, (change, sound, _) in WRONG.items():
        folder = shutil.copytree(exported(lds_file), tmp_path / name)
        if change:
            change(folder)
        (tmp_path / f"{name}.wav").write_bytes(sound)
        command = [node, "speak.mjs", str(folder), str(tmp_path / f"{name}.wav")]
        done = subprocess.run(command, cwd=here, check=False, capture_output=True, text=True, timeout=1800)
        said[name] = (done.returncode, done.stderr)
    for name, (_, _, message) in WRONG.items():
        assert said[name][0] != 0, name
        assert message in said[name][1], (name, said[name][1])
        assert said[name][1].strip().count("\n") == 0, said[name][1]


def test_node_refuses_in_one_line_what_it_cannot_hear_with(default_lds_file, coarticulation_file, exported, tmp_path):
    here, node = installed("node"), shutil.which("node")
    (tmp_path / "a.wav").write_bytes(wav())
    for script, model, message in (
        (
            "speak.mjs",
            default_lds_file,
            "this system hears with the phone network; wanted one that was trained with hears",
        ),
        ("speak.mjs", coarticulation_file, "a model of method coarticulation; wanted lds"),
        ("hear.mjs", coarticulation_file, "a model of method coarticulation; wanted what `facesynth export phones` writes"),
    ):
        command = [node, script, str(exported(model)), str(tmp_path / "a.wav")]
        done = subprocess.run(command, cwd=here, check=False, capture_output=True, text=True, timeout=1800)
        assert (done.returncode, done.stdout) == (1, "")
        assert message in done.stderr
        assert done.stderr.strip().count("\n") == 0, done.stderr


def test_the_page_is_not_made_of_a_system_that_it_cannot_hear_with(default_lds_file, rig, tmp_path):
    make_site = runpy.run_path(str(EXAMPLES / "browser" / "make_site.py"))["main"]
    with pytest.raises(FacesynthError, match="hears with the phone network, the page does not; train one with hears=period"):
        make_site(default_lds_file, tmp_path / "a.wav", tmp_path / "site")


def test_node_takes_the_mean_of_the_channels(lds_file, exported, tmp_path):
    from facesynth.inference.wav import read_wav

    sound, folder = tmp_path / "stereo.wav", exported(lds_file)
    sound.write_bytes(wav(channels=2, samples=8000))
    said = said_by_node("speak.mjs", folder, sound)
    stream = load(folder).stream(noise=0.0)
    wanted = np.concatenate([stream.push(read_wav(sound)[0]), stream.finish()])
    assert np.abs(np.array(said["frames"]).reshape(wanted.shape) - wanted).max() < 1e-2  # mm


@pytest.mark.slow
def test_the_page_speaks_in_a_browser_without_a_network(talking_head, tmp_path):
    model, sound = talking_head
    browser = a_browser()
    example = installed("browser")
    here = tmp_path / "page"
    shutil.copytree(example, here, ignore=shutil.ignore_patterns("site", "node_modules"))
    (here / "node_modules").symlink_to(example / "node_modules")
    subprocess.run([sys.executable, "make_site.py", str(model), str(sound)], cwd=here, check=True, timeout=1800)
    subprocess.run([shutil.which("node"), "build.mjs"], cwd=here, check=True, timeout=1800)
    report = visited(browser, here / "site", tmp_path)
    assert "error" not in report, report
    frames = np.array(report["frames"]).reshape(report["count"], report["channels"])
    assert np.abs(frames - expected(here / "site" / "model", sound)).max() < 1e-2  # mm
    picture = base64.b64decode(report["picture"].partition(",")[2])
    (tmp_path / "page.png").write_bytes(picture)
    assert colours(tmp_path / "page.png") > 100  # a shaded head, no empty canvas
    assert report["said"].endswith("on 1 thread (the page is not cross-origin isolated)")
    graph = damaged(here / "site" / "model")
    assert f"{graph} is no graph that onnxruntime runs" in visited(browser, here / "site", tmp_path)["error"]


def damaged(folder):
    """The name of a graph of an exported folder that is no graph any more, though its hash is what the manifest says."""
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    del manifest["sha256"]
    name = next(iter(manifest["graphs"].values()))["file"]
    (folder / name).write_bytes((folder / name).read_bytes()[:1000])
    manifest["files"][name]["sha256"] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
    plain = json.dumps(manifest, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    manifest["sha256"] = hashlib.sha256(plain.encode()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest, ensure_ascii=False), encoding="utf-8")
    return name
