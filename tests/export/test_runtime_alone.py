"""The runtime with nothing but numpy and onnxruntime."""

import json
import os
import re
import shutil
import struct
import subprocess
import sys
import wave
import zipfile

import numpy as np
import pytest
from corpora import RATE

from facesynth.export.graph import difference
from facesynth.inference import FacesynthError
from facesynth.inference.__main__ import main
from facesynth.methods.registry import load as load_torch

STRANGERS = ("torch", "torchaudio", "kornia", "sklearn", "scipy", "numba", "facesynth", "safetensors", "librosa", "soundfile")
MOST_BYTES = 180e6

SPEAK = """
import sys, json
refused = set(sys.argv[1].split(","))
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in refused:
            raise ImportError(name + " is not part of the runtime")
sys.meta_path.insert(0, Refuse())
import numpy as np
from facesynth_runtime import EmotionTrack, PhoneTrack, Speech, load
asked = np.load(sys.argv[2])
phones = PhoneTrack(tuple(asked["labels"].tolist()), asked["ends_s"])
speech = Speech(asked["audio"], int(asked["rate"]), phones, EmotionTrack.constant(str(asked["emotion"]), phones.duration_s))
out = {}
for folder in sys.argv[4:]:
    model = load(folder)
    if hasattr(model, "detect"):
        out["emotion"] = np.array(list(model.detect(speech.audio, speech.sample_rate).probabilities.values()))
    else:
        out[model.manifest["method"]] = model.synthesize(speech, seed=5).frames
assert not refused & {name.split(".")[0] for name in sys.modules}
np.savez(sys.argv[3], **out)
"""


@pytest.fixture(scope="module")
def folders(lds_file, efase_file, anime_file, emotion_file, exported):
    return [exported(path) for path in (lds_file, efase_file, anime_file, emotion_file)]


@pytest.fixture(scope="module")
def asked(speeches, tmp_path_factory):
    speech = speeches[1]
    path = tmp_path_factory.mktemp("asked") / "speech.npz"
    labels, emotion = np.array(speech.phones.labels), speech.emotions.labels[0]
    np.savez(path, audio=speech.audio, rate=RATE, labels=labels, ends_s=speech.phones.ends_s, emotion=emotion)
    return path


def compare(answers, speech, lds_file, efase_file, anime_file, emotion_file):
    from facesynth.methods.emotion.detector import EmotionDetector

    with np.load(answers) as got:
        for path in (lds_file, efase_file, anime_file):
            model = load_torch(path)
            assert difference(got[model.name], model.synthesize(speech, seed=5).frames) < 1e-4, model.name
        wanted = EmotionDetector.load(emotion_file).detect(speech.audio, RATE).probabilities
        assert np.allclose(got["emotion"], list(wanted.values()), rtol=1e-4)


def test_every_method_speaks_where_torch_cannot_be_imported(
    folders, asked, speeches, runtime_folder, tmp_path, lds_file, efase_file, anime_file, emotion_file
):
    answers, own = tmp_path / "answers.npz", {**os.environ, "PYTHONPATH": str(runtime_folder)}
    command = [sys.executable, "-c", SPEAK, ",".join(STRANGERS), str(asked), str(answers), *map(str, folders)]
    subprocess.run(command, check=True, env=own, cwd=tmp_path, timeout=1800)
    compare(answers, speeches[1], lds_file, efase_file, anime_file, emotion_file)


@pytest.mark.slow
def test_an_environment_with_only_that_distribution(
    folders, asked, speeches, repository, tmp_path, lds_file, efase_file, anime_file, emotion_file
):
    home = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", str(home)], check=True, timeout=1800)
    python = home / ("Scripts" if os.name == "nt" else "bin") / "python"
    base = sum(path.stat().st_size for path in home.rglob("*") if path.is_file() and not path.is_symlink())
    done = subprocess.run(
        [python, "-m", "pip", "install", "-q", str(repository / "export" / "runtime")],
        check=False,
        capture_output=True,
        text=True,
        timeout=1800,
    )
    if done.returncode:
        pytest.skip(f"numpy and onnxruntime cannot be installed here: {done.stderr.strip().splitlines()[-1:]}")
    size = sum(path.stat().st_size for path in home.rglob("*") if path.is_file() and not path.is_symlink()) - base
    listed = subprocess.run(
        [python, "-m", "pip", "list", "--format=json"], capture_output=True, text=True, check=True, timeout=60
    )
    names = {entry["name"].lower() for entry in json.loads(listed.stdout)}
    assert not names & {"torch", "torchaudio", "kornia", "scikit-learn", "scipy", "facesynth"}
    print(f"installed: {size / 1e6:.0f} MB, {sorted(names)}")
    assert size < MOST_BYTES
    answers = tmp_path / "answers.npz"
    command = [python, "-c", SPEAK, ",".join(STRANGERS), str(asked), str(answers), *map(str, folders)]
    subprocess.run(command, check=True, cwd=tmp_path, timeout=1800)
    compare(answers, speeches[1], lds_file, efase_file, anime_file, emotion_file)


def test_nothing_in_the_source_names_torch(runtime_folder):
    import ast

    for path in (runtime_folder / "facesynth_runtime").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else [getattr(node, "module", None) or ""]
            assert not {name.split(".")[0] for name in names} & set(STRANGERS), path


def test_the_command_line(folders, speeches, tmp_path, capsys):
    sound, phones = tmp_path / "line.wav", tmp_path / "line.txt"
    with wave.open(str(sound), "wb") as file:
        file.setparams((1, 2, RATE, 0, "NONE", ""))
        file.writeframes((speeches[0].audio * 32767).astype("<i2").tobytes())
    track = speeches[0].phones
    phones.write_text("".join(f"{end} {label}\n" for label, end in zip(track.labels, track.ends_s, strict=True)))
    main([str(folders[1]), str(sound), "--phones", str(phones), "-o", str(tmp_path / "motion.npz")])
    with np.load(tmp_path / "motion.npz") as motion:
        assert motion["frames"].shape == (round(track.duration_s * 60), 42)
    main([str(folders[3]), str(sound)])
    assert set(json.loads(capsys.readouterr().out)) == {"neutral", "happy", "angry", "sad"}
    with pytest.raises(SystemExit, match="2"):
        main([str(tmp_path), str(sound)])
    assert "manifest.json: no such file" in capsys.readouterr().err


def riff(channels=1, bits=16, kind=1, samples=4000, cut=0, rate=RATE):
    """A WAV file of noise, written by hand."""
    width = channels * bits // 8
    head = struct.pack("<HHIIHH", kind, channels, rate, rate * width, width, bits)
    if kind == 0xFFFE:
        head += struct.pack("<HHI", 22, bits, 0) + struct.pack("<H", 1) + bytes.fromhex("000000001000800000AA00389B71")
    data = np.random.default_rng(0).integers(0, 256, samples * width, np.uint8).tobytes()
    parts = b"".join(name + struct.pack("<I", len(c)) + c for name, c in ((b"fmt ", head), (b"data", data)))
    content = b"RIFF" + struct.pack("<I", 4 + len(parts)) + b"WAVE" + parts
    return content[: len(content) - cut]


def test_what_the_command_line_refuses(folders, tmp_path, capsys, exported, lds_file):
    from facesynth.export.parts import export_features

    lds, parts, sound, out = str(folders[0]), tmp_path / "features", tmp_path / "s.wav", ["-o", str(tmp_path / "m.npz")]
    export_features(parts)
    wrong = [
        (riff(cut=501), [lds, *out], "is truncated"),
        (riff()[:40], [lds, *out], "truncated"),
        (riff()[:20], [lds, *out], "damaged header"),
        (b"", [lds, *out], "no WAV file"),
        (riff(samples=0), [lds, *out], "holds no samples"),
        (riff(bits=8), [lds, *out], "has 8 bits a sample"),
        (riff(bits=32, kind=3), [lds, *out], "in coding 3"),
        (riff(channels=0), [lds, *out], "holds no samples|states 0 channels"),
        (riff(), [lds, "-o", str(tmp_path / "nowhere" / "m.npz")], "there is no folder"),
        (riff(), [lds, "-o", str(tmp_path)], "s a directory|cannot be written"),
        (riff(), [lds], "wanted -o"),
        (riff(), [lds, *out, "--seed", "-1"], "seed is -1"),
        (riff(), [lds, *out, "--emotion", "bored"], "unknown emotion 'bored'"),
        (riff(), [str(parts), *out], "holds graphs"),
    ]
    for content, (folder, *options), message in wrong:
        sound.write_bytes(content)
        with pytest.raises(SystemExit, match="2"):
            main([folder, str(sound), *options])
        said = capsys.readouterr().err
        assert re.search(message, said), said
        assert said.count("\n") == 1


def test_the_extended_header_and_channels(folders, tmp_path, capsys):
    frames = {}
    for name, content in {"plain": riff(), "extended": riff(kind=0xFFFE), "stereo": riff(channels=2)}.items():
        (tmp_path / "s.wav").write_bytes(content)
        main([str(folders[0]), str(tmp_path / "s.wav"), "-o", str(tmp_path / f"{name}.npz")])
        with np.load(tmp_path / f"{name}.npz") as motion:
            frames[name] = motion["frames"]
    assert np.array_equal(frames["plain"], frames["extended"])
    assert frames["stereo"].shape == frames["plain"].shape
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out.startswith("facesynth-runtime ")


def test_threads_are_at_least_one(folders):
    from facesynth.inference import load

    with pytest.raises(FacesynthError, match="threads is 0"):
        load(folders[0], threads=0)


def test_calls_are_those_of_the_torch_models(folders):
    import inspect

    from facesynth.inference import load
    from facesynth.methods.emotion.detector import EmotionDetector
    from facesynth.methods.registry import method_class

    def asked(function):
        return {
            n: p.default for n, p in inspect.signature(function).parameters.items() if n != "self" and p.kind != p.VAR_KEYWORD
        }

    for folder in folders[:3]:
        runtime = load(folder)
        wanted, got = asked(method_class(runtime.manifest["method"]).synthesize), asked(runtime.synthesize)
        wanted.pop("edits", None)  # nodes are changed where the corpus is
        assert wanted.items() <= got.items()
    for name in ("detect", "detect_track", "features"):
        assert list(asked(getattr(EmotionDetector, name))) == list(asked(getattr(load(folders[3]), name)))


def built(source, out):
    """What pip says of building a wheel, and the names of the files in it."""
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-w", out, source]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=1800)
    wheels = list(out.glob("*.whl"))
    return done.stdout + done.stderr, set(zipfile.ZipFile(wheels[0]).namelist()) if wheels else set()


def test_the_wheel_carries_that_folder_alone(repository, tmp_path):
    said, names = built(repository / "export" / "runtime", tmp_path)
    folder = repository / "facesynth" / "inference"
    assert {name for name in names if ".dist-info/" not in name} == {
        f"facesynth_runtime/{path.relative_to(folder).as_posix()}" for path in folder.rglob("*.py")
    }, said
    left = {path.name for path in (repository / "export" / "runtime").iterdir()}
    assert not left & {"facesynth_runtime", "facesynth_runtime.egg-info"}


def test_a_source_distribution_builds_the_same_wheel(repository, tmp_path):
    copy = shutil.copytree(repository / "export" / "runtime", tmp_path / "checkout" / "export" / "runtime")
    shutil.copytree(repository / "facesynth" / "inference", tmp_path / "checkout" / "facesynth" / "inference")
    make = "import sys; from setuptools import build_meta; build_meta.build_sdist(sys.argv[1])"
    subprocess.run([sys.executable, "-c", make, str(tmp_path)], cwd=copy, check=True, capture_output=True, timeout=1800)
    wheels = [built(source, tmp_path / name)[1] for name, source in (("a", copy), ("b", next(tmp_path.glob("*.tar.gz"))))]
    assert wheels[0] == wheels[1] != set()


def test_a_copy_without_its_source_says_what_it_wants(repository, tmp_path):
    copy = shutil.copytree(repository / "export" / "runtime", tmp_path / "export" / "runtime")
    said, names = built(copy, tmp_path / "wheels")
    assert "it is built from facesynth/inference, two folders up; build it inside of a checkout" in said
    assert not names
