"""Two Ray workers; in a process of their own, for Ray leaves threads and warnings behind."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from corpora import tiny_layout, tiny_utterances
from interrupted import lasting

from facesynth.corpus import Corpus
from facesynth.corpus.add.add import add
from facesynth.speech.audio import load_audio, save_wav
from facesynth.speech.textgrid import write_textgrid

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="ray is not installed: pip install 'facesynth[ray]'"
)


def python(code, *arguments, **environment):
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
        env={**os.environ, **environment},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def new(folder):
    return Corpus.create(folder, performer="A", layout=tiny_layout(), fps=120, emotions=["neutral"]).path


def spoken(folder, recordings):
    """Two real recordings with their words, and motion that stands still."""
    folder.mkdir()
    for name, words in (("01", "Kids are talking by the door."), ("02", "Dogs are sitting by the door.")):
        audio, rate = load_audio(min(recordings("ravdess_speech").rglob(f"03-01-01-01-{name}-01-01.flac")))
        save_wav(folder / f"{name}.wav", audio, rate)
        (folder / f"{name}.txt").write_text(words, encoding="utf-8")
        frames = np.tile(np.array(tiny_layout().neutral, np.float32), (round(len(audio) / rate * 120), 1))
        np.savez(folder / f"{name}.npz", frames=frames, head=np.zeros((len(frames), 6)), fps=120.0)
    return folder


def test_two_ray_workers_give_the_same_bytes_as_one_process_and_a_dead_one_is_replaced(tmp_path):
    """The worker that holds the fourth recording dies in the middle of the import."""
    session = tmp_path / "session"
    session.mkdir()
    for record, speech, motion in tiny_utterances(6):
        save_wav(session / f"{record.id}.wav", speech.audio, speech.sample_rate)
        write_textgrid(session / f"{record.id}.TextGrid", speech.phones, ())
        np.savez(session / f"{record.id}.npz", frames=motion.frames, fps=motion.fps, head=motion.head)
    (session / "hurt.wav").write_bytes(b"RIFF")
    (session / "hurt.npz").write_bytes(b"PK")
    alone = add(Corpus.open(new(tmp_path / "alone")), [session])
    out = python(
        """
        import json, os, sys
        from pathlib import Path
        import facesynth.corpus.add.add as adding
        from facesynth.corpus import Corpus
        from facesynth.corpus.workers import Workers

        attempt = adding.attempt

        def dying(task, name=sys.argv[4], marker=sys.argv[3]):
            if task[1].id == name and not Path(marker).exists():
                Path(marker).touch()
                os._exit(9)
            return attempt(task)

        adding.attempt = dying
        report = adding.add(Corpus.open(sys.argv[1]), [sys.argv[2]], workers=Workers(2, "ray"))
        print(json.dumps([report.added, sorted(report.refused)]))
        """,
        new(tmp_path / "rays"),
        session,
        tmp_path / "marker",
        tiny_utterances(6)[3][0].id,
    )
    assert json.loads(out) == [list(alone.added), ["hurt"]]
    assert (tmp_path / "marker").exists(), "a worker died"
    assert lasting(tmp_path / "rays") == lasting(tmp_path / "alone")


def test_alignment_and_features_of_voices_are_the_same_over_ray(recordings, tmp_path):
    session = spoken(tmp_path / "session", recordings)
    add(Corpus.open(new(tmp_path / "alone")), [session])
    grids = sorted((tmp_path / "alone" / "phones").iterdir())
    shutil.copytree(tmp_path / "alone", tmp_path / "rays")
    for path in (tmp_path / "rays" / "phones").iterdir():
        path.unlink()
    out = python(
        """
        import json, sys
        import numpy as np
        from facesynth.corpus import Corpus
        from facesynth.corpus.align import align
        from facesynth.corpus.workers import Workers
        from facesynth.methods.emotion.detector import Clip, EmotionDetector

        rays = Workers(2, "ray")
        corpus = Corpus.open(sys.argv[1])
        print(json.dumps(align(corpus, workers=rays).aligned))
        clips = [Clip(u.speech.audio, u.speech.sample_rate, emotion="neutral") for u in corpus]
        detector = EmotionDetector()
        assert np.array_equal(detector.features_of(clips, rays), detector.features_of(clips))
        """,
        tmp_path / "rays",
    )
    assert json.loads(out) == ["01", "02"]
    assert len(grids) == 2
    assert lasting(tmp_path / "rays") == lasting(tmp_path / "alone")


@pytest.mark.slow
def test_faces_followed_by_ray_give_the_same_bytes(recordings, landmark_models, tmp_path):
    """Each engine with a cache of its own, so that each follows the faces itself."""
    clips = [recordings("grid_s26") / f"{name}.mpg" for name in ("bgbsza", "lrbi7p", "swbm3n")]
    for engine in ("processes", "ray"):
        shutil.copytree(landmark_models, tmp_path / engine / "landmarks")
        python(
            "import sys; from facesynth.cli import main; main()",
            *("corpus", "add", tmp_path / f"by {engine}", *clips, "--performer", "A", "--engine", engine, "--jobs", 2),
            FACESYNTH_CACHE=str(tmp_path / engine),
        )
    assert len(Corpus.open(tmp_path / "by ray")) == 3
    assert lasting(tmp_path / "by ray") == lasting(tmp_path / "by processes")
