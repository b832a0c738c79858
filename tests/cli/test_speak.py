"""The real command line on a small corpus: what it writes, and how it refuses."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from corpora import tiny_corpus

from facesynth.cli import cli, main
from facesynth.cli.speak import speak
from facesynth.methods.efase.method import Efase
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid
from facesynth.stage.performance import OUTPUTS


def run(*arguments):
    """`facesynth ARGUMENTS` with the real entry point: exit code, standard output, standard error."""
    program = "import sys; from facesynth.cli import main; sys.argv = ['facesynth', *sys.argv[1:]]; main()"
    command = [sys.executable, "-c", program, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=1800)
    return done.returncode, done.stdout, done.stderr


def refused(monkeypatch, capsys, *arguments):
    """The one line of an error, in this process."""
    monkeypatch.setattr(sys, "argv", ["facesynth", *map(str, arguments)])
    with pytest.raises(SystemExit) as left:
        main()
    lines = capsys.readouterr().err.strip().splitlines()
    assert left.value.code == 2
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    return lines[0]


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """A corpus, a model and a recording with its phones, in a folder with a difficult name."""
    folder = tmp_path_factory.mktemp("Büro mit Ümläuten")
    corpus = tiny_corpus(folder / "actor", utterances=12, fps=60)
    Efase().fit(corpus).save(folder / "efase.safetensors")
    speech = corpus[corpus.ids[0]].speech
    save_wav(folder / "línea 1.wav", speech.audio, speech.sample_rate)
    write_textgrid(folder / "línea 1.TextGrid", speech.phones)
    return folder


def test_help_names_every_verb_without_importing_torch():
    program = "import sys; from facesynth.cli import cli; from click.testing import CliRunner; "
    program += "r = CliRunner().invoke(cli, ['--help']); assert r.exit_code == 0, r; print(r.output, 'torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=1800)
    assert done.stdout.strip().endswith("False")
    for verb in ("demo", "corpus", "train", "speak", "emotion", "tune", "evaluate"):
        assert verb in done.stdout


def test_train_writes_the_same_model_twice(shop, tmp_path):
    paths = [tmp_path / "a.safetensors", tmp_path / "b.safetensors"]
    for path in paths:
        result = CliRunner().invoke(cli, ["train", "efase", str(shop / "actor"), "penalty=12", "-o", str(path), "--json"])
        assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["utterances"] == 12
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_the_training_script_runs(shop, tmp_path, script):
    model = tmp_path / "m.safetensors"
    assert "marker error" in script("efase.py", shop / "actor", "-o", model, "components=6")
    assert model.exists()


@pytest.mark.usefixtures("rig")
def test_speak_writes_the_same_bytes_twice_and_explains(tmp_path):
    from facesynth.face.rig.arkit_rig import load_head
    from facesynth.face.rig.markers import marker_layout

    model = head_model(tmp_path, marker_layout(load_head()))
    outputs = []
    for name in ("first", "second"):
        folder = tmp_path / name
        given = [
            "-o",
            folder / "{name}.csv",
            "-o",
            folder / "{name}.npz",
            "-o",
            folder / "{name}.glb",
            "-o",
            folder / "{name}.bvh",
        ]
        explain = folder / "why.json"
        result = CliRunner().invoke(
            cli,
            [
                "speak",
                str(model),
                str(tmp_path / "clip ä.wav"),
                *map(str, given),
                "--explain",
                str(explain),
                "--fps",
                "29.97",
                "--json",
            ],
        )
        assert result.exit_code == 0, result.output
        facts = json.loads(result.stdout)
        assert facts["phones"] == "textgrid"
        assert len(json.loads(explain.read_text(encoding="utf-8"))) > 3
        outputs.append({p.suffix: p.read_bytes() for p in folder.iterdir()})
    assert outputs[0] == outputs[1]
    assert set(outputs[0]) == {".csv", ".npz", ".glb", ".bvh", ".json"}


def head_model(folder, layout):
    """eFASE on a few sentences of made-up motion of the head's own markers, and a recording to speak."""
    from facesynth.corpus import Corpus
    from facesynth.inference.motion import Motion

    corpus = Corpus.create(
        folder / "head", performer="Tiny", layout=layout, fps=60, emotions=["neutral", "happy", "angry", "sad"]
    )
    rng = np.random.default_rng(0)
    source = tiny_corpus(folder / "source", utterances=6, fps=60)
    for utterance in source:
        sway = np.cumsum(rng.normal(size=(len(utterance.motion), layout.channels)), axis=0) * 0.02
        motion = Motion(np.asarray(layout.neutral) + sway, 60, layout)
        corpus.add_utterance(source.record(utterance.id), utterance.speech, motion)
    path = folder / "head.safetensors"
    Efase().fit(corpus).save(path)
    speech = utterance.speech
    save_wav(folder / "clip ä.wav", speech.audio, speech.sample_rate)
    write_textgrid(folder / "clip ä.TextGrid", speech.phones)
    return path


def test_silence_and_short_sounds(shop, tmp_path, monkeypatch, capsys):
    model, out = shop / "efase.safetensors", tmp_path / "o.npz"
    for samples, name in ((np.zeros(0), "none"), (np.zeros(160), "10 ms"), (np.zeros(32000), "silence")):
        sound = tmp_path / f"{name}.wav"
        save_wav(sound, samples.astype(np.float32), 16000)
        refused(monkeypatch, capsys, "speak", model, sound, "-o", out, "--text", "hello there")
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--emotion", "bored"], "emotion 'bored'"),
        (["--fps", "0"], "wanted a rate"),
        (["--head", "much"], "wanted off, recorded, a factor"),
        (["--size", "12x"], "WIDTHxHEIGHT"),
        (["--constraints", "CONSTRAINTS"], "unknown node"),
        (["--text", "a", "--text-file", "b"], "give one"),
        (["--phones", "nothing.TextGrid"], "nothing.TextGrid"),
    ],
)
def test_wrong_options(shop, tmp_path, monkeypatch, capsys, arguments, message):
    constraints = tmp_path / "c.csv"
    constraints.write_text("phone_index,utterance_id,phone_number\n1,nobody,3\n", encoding="utf-8")
    arguments = [str(constraints) if a == "CONSTRAINTS" else a for a in arguments]
    out = tmp_path / "out.npz"
    line = refused(monkeypatch, capsys, "speak", shop / "efase.safetensors", shop / "línea 1.wav", "-o", out, *arguments)
    assert message in line
    assert list(tmp_path.iterdir()) == [constraints]


def test_wrong_files(shop, tmp_path, monkeypatch, capsys):
    sound, model = shop / "línea 1.wav", shop / "efase.safetensors"
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(model.read_bytes()[:5000])
    assert "truncated" in refused(monkeypatch, capsys, "speak", broken, sound, "-o", tmp_path / "o.npz")
    (notes := tmp_path / "notes.txt").write_text("no model")
    assert "not a facesynth model" in refused(monkeypatch, capsys, "speak", notes, sound, "-o", tmp_path / "o.npz")
    assert "no such file" in refused(monkeypatch, capsys, "speak", model, tmp_path / "no.wav", "-o", tmp_path / "o.npz")
    assert "output type" in refused(monkeypatch, capsys, "speak", model, sound, "-o", tmp_path / "o.xyz")
    assert "{name}" in refused(monkeypatch, capsys, "speak", model, sound, sound, "-o", tmp_path / "o.npz")
    assert "no setting" in refused(monkeypatch, capsys, "train", "efase", shop / "actor", "penalty")
    assert "did you mean penalty" in refused(monkeypatch, capsys, "train", "efase", shop / "actor", "penaly=3")
    assert "unknown method" in refused(monkeypatch, capsys, "train", "efaze", shop / "actor")
    assert set(tmp_path.iterdir()) == {broken, notes}


def test_nan_in_motion_and_a_lone_utterance(tmp_path, monkeypatch, capsys):
    corpus = tiny_corpus(tmp_path / "actor", utterances=4, fps=60)
    for name in corpus.ids:
        path = corpus.path / "motion" / f"{name}.npz"
        with np.load(path) as file:
            arrays = dict(file)
        np.savez(path, **{**arrays, "frames": np.full_like(arrays["frames"], np.nan)})
    line = refused(monkeypatch, capsys, "train", "efase", corpus.path, "-o", tmp_path / "m.safetensors")
    assert "NaN" in line or "complete" in line
    lone = tiny_corpus(tmp_path / "lone", utterances=1, fps=60)
    assert "at least 2" in refused(monkeypatch, capsys, "train", "efase", lone.path, "-o", tmp_path / "m.safetensors")
    assert not (tmp_path / "m.safetensors").exists()


def test_a_write_that_fails_half_way_leaves_nothing(shop, tmp_path, monkeypatch, capsys):
    import facesynth.methods.model_file as module

    def full_disk(tensors, path, metadata):
        Path(path).write_bytes(b"half")
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(module, "save_file", full_disk)
    line = refused(monkeypatch, capsys, "train", "efase", shop / "actor", "-o", tmp_path / "m.safetensors")
    assert "No space left" in line
    assert not list(tmp_path.iterdir())


def test_an_interrupted_write_leaves_nothing(shop, tmp_path, monkeypatch):
    import facesynth.methods.model_file as module

    def interrupted(tensors, path, metadata):
        Path(path).write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "save_file", interrupted)
    monkeypatch.setattr(sys, "argv", ["facesynth", "train", "efase", str(shop / "actor"), "-o", str(tmp_path / "m.safetensors")])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 130
    assert not list(tmp_path.iterdir())


def test_the_entry_point_leaves_with_code_2():
    code, _, error = run("speak", "nothing.safetensors", "nothing.wav", "-o", "x.npz")
    assert code == 2
    assert error.strip().count("\n") == 0


def test_help_and_manual_name_every_output(repository):
    said = next(param.help for param in speak.params if param.name == "outputs")
    assert set(re.findall(r"\.[a-z0-9]+", said)) == set(OUTPUTS)
    table = (repository / "docs" / "own_head.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(\.\w+)` \|", table, re.MULTILINE)) == set(OUTPUTS)
