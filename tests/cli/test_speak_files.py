"""What `speak` writes where, and what it leaves alone."""

import json
import resource
import signal
import subprocess
import sys
import time

import pytest
from corpora import tiny_corpus

from facesynth.cli import main
from facesynth.cli.targets import plan_targets
from facesynth.inference.errors import FacesynthError
from facesynth.methods.efase.method import Efase
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid

PROGRAM = "import sys; from facesynth.cli import main; sys.argv = ['facesynth', *sys.argv[1:]]; main()"


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    corpus = tiny_corpus(folder / "actor", utterances=12, fps=60)
    Efase().fit(corpus).save(folder / "efase.safetensors")
    return folder / "efase.safetensors", corpus[corpus.ids[0]].speech


def recorded(folder, model, *names):
    folder.mkdir(exist_ok=True)
    for name in names:
        save_wav(folder / f"{name}.wav", model[1].audio, model[1].sample_rate)
        write_textgrid(folder / f"{name}.TextGrid", model[1].phones)
    return folder


def code(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["facesynth", *map(str, arguments)])
    try:
        main()
    except SystemExit as left:
        return left.code
    return 0


def test_a_recording_is_never_written_over(tmp_path):
    video = tmp_path / "in.mp4"
    with pytest.raises(FacesynthError, match="is a recording"):
        plan_targets([video], [video], [])
    with pytest.raises(FacesynthError, match="would both be written"):
        plan_targets([tmp_path / "a.wav", tmp_path / "a.flac"], [tmp_path / "out" / "{name}.csv"], [tmp_path])
    with pytest.raises(FacesynthError, match="stands for nothing"):
        plan_targets([video], [tmp_path / "{nme}.csv"], [])


def test_what_is_read_is_never_written_over(tmp_path, model, monkeypatch, capsys):
    recorded(tmp_path, model, "a")
    (tmp_path / "mask.glb").write_bytes(b"a head")
    (tmp_path / "e.csv").write_text("time_s,emotion\n")
    (tmp_path / "actor").mkdir()
    (tmp_path / "actor" / "corpus.yaml").write_text("format: 1\n")
    (tmp_path / "actor" / "motion").mkdir()
    (tmp_path / "actor" / "motion" / "a.npz").write_bytes(b"motion")
    read = {"mask.glb": ["--rig", tmp_path / "mask.glb"], "e.csv": ["--emotions", tmp_path / "e.csv"], "actor/motion/a.npz": []}
    for name, options in read.items():
        before = (tmp_path / name).read_bytes()
        assert code(monkeypatch, "speak", model[0], tmp_path / "a.wav", *options, "-o", tmp_path / name) == 2
        assert "write to another file" in capsys.readouterr().err
        assert (tmp_path / name).read_bytes() == before
    with pytest.raises(FacesynthError, match="is read"):
        plan_targets([tmp_path / "a.wav"], [tmp_path / "x" / ".." / "mask.glb"], [], [tmp_path / "mask.glb"])


def test_results_among_the_recordings_of_a_folder_are_no_recordings(tmp_path):
    recordings = [tmp_path / "a.mp4", tmp_path / "a.wav", tmp_path / "b.wav"]
    plan = plan_targets(recordings, [tmp_path / "{name}.mp4"], [tmp_path])
    assert list(plan) == [tmp_path / "a.wav", tmp_path / "b.wav"]


def test_a_bad_recording_does_not_stop_the_others(model, tmp_path, monkeypatch, capsys):
    folder = recorded(tmp_path / "lines", model, "a", "z")
    save_wav(folder / "m.wav", model[1].audio[:100], model[1].sample_rate)
    left = code(monkeypatch, "speak", model[0], folder, "-o", tmp_path / "out" / "{name}.npz", "--json")
    out, error = capsys.readouterr()
    assert left == 2
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.npz", "z.npz"]
    assert [row["speech"][-5:] for row in json.loads(out)] == ["a.wav", "z.wav"]
    assert "m.wav" in error
    assert "1 of 3 recordings" in error


def test_a_corrected_textgrid_stays(tmp_path, model):
    from facesynth.speech.hearing import Heard
    from facesynth.stage.listening import keep_phones

    told = []

    heard = Heard(model[1], (), (), "transcript")
    grid = tmp_path / "a.TextGrid"
    assert keep_phones(grid, heard, told.append)
    assert keep_phones(grid, heard, told.append), "the same again is no correction"
    corrected = grid.read_text().replace(f'"{model[1].phones.labels[1]}"', '"aa"', 1)
    grid.write_text(corrected)
    assert not told
    assert not keep_phones(grid, heard, told.append)
    assert grid.read_text() == corrected
    assert "stays as it is" in told[0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--emotion", "happy", "--emotions", "e.csv"), "give one"),
        (("--emotions", "e.csv", "--intensity", "0.2"), "of its own"),
        (("--emotion", "bored"), "unknown emotion"),
        (("--head", "inf"), "wanted off, recorded, a factor"),
        (("--seed", "-1"), "seed"),
    ],
)
def test_options_that_contradict_are_refused_before_anything_is_heard(model, tmp_path, monkeypatch, capsys, arguments, message):
    recorded(tmp_path, model, "a")
    left = code(monkeypatch, "speak", model[0], tmp_path / "a.wav", "-o", tmp_path / "x.npz", *arguments)
    error = capsys.readouterr().err.strip()
    assert left == 2
    assert message in error
    assert error.count("\n") == 0


@pytest.mark.parametrize("setting", ["penalty=foo", "bridge_pauses=3", "components=[1]"])
def test_settings_of_the_wrong_kind(model, tmp_path, monkeypatch, capsys, setting):
    assert code(monkeypatch, "train", "efase", model[0].parent / "actor", setting, "-o", tmp_path / "m.safetensors") == 2
    assert setting.partition("=")[0] in capsys.readouterr().err


def limited(limit, *arguments):
    """The command line in a process whose files may have at most `limit` bytes."""

    def lower():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    return subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=1800,
        preexec_fn=lower,
    )


@pytest.mark.skipif(sys.platform == "win32", reason="limits of file sizes are POSIX")
def test_a_limit_of_file_size_is_one_line_and_leaves_nothing(model, tmp_path):
    recorded(tmp_path, model, "a")
    (tmp_path / "out").mkdir()
    speak = limited(8000, "speak", model[0], tmp_path / "a.wav", "-o", tmp_path / "out" / "a.npz")
    train = limited(8000, "train", "efase", model[0].parent / "actor", "-o", tmp_path / "out" / "m.safetensors")
    for done, name in ((speak, "a.npz"), (train, "m.safetensors")):
        assert done.returncode == 2, done.stderr
        assert name in done.stderr.splitlines()[-1]
        assert "Traceback" not in done.stderr
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX")
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_the_middle_leaves_nothing(model, tmp_path, sent):
    recorded(tmp_path, model, "a")
    slow = (
        "import signal, time\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # tests that run in the background inherit deaf ears
        "import facesynth.stage.performance as s\n"
        "from facesynth.atomic import atomic_path\n"
        "def hang(self, path):\n"
        "    with atomic_path(path) as part:\n"
        "        part.write_bytes(b'half'); print('writing', flush=True); time.sleep(60)\n"
        "s.Performance.write = hang\n"
    )
    command = [sys.executable, "-c", slow + PROGRAM, "speak", model[0], tmp_path / "a.wav", "-o", tmp_path / "o" / "a.npz"]
    with subprocess.Popen([str(c) for c in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline().strip() == "writing", process.stderr.read()
        time.sleep(0.2)
        process.send_signal(sent)
        _, error = process.communicate(timeout=1800)
    assert process.returncode == 130
    assert "interrupted" in error.splitlines()[-1]
    assert not list((tmp_path / "o").iterdir())
