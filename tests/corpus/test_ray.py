"""Two Ray workers; in a process of their own, for Ray leaves threads and warnings behind."""

import importlib.util
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from corpora import tiny_layout, tiny_utterances
from interrupted import contents

from facesynth.corpus import Corpus
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="ray is not installed: pip install 'facesynth[ray]'"
)


def python(code, *arguments):
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def new(folder):
    return Corpus.create(folder, performer="A", layout=tiny_layout(), fps=120, emotions=["neutral"]).path


def test_two_ray_workers_give_the_same_bytes_as_one_process_and_a_dead_one_is_replaced(tmp_path):
    session = tmp_path / "session"
    session.mkdir()
    for record, speech, motion in tiny_utterances(6):
        save_wav(session / f"{record.id}.wav", speech.audio, speech.sample_rate)
        write_textgrid(session / f"{record.id}.TextGrid", speech.phones, ())
        np.savez(session / f"{record.id}.npz", frames=motion.frames, fps=motion.fps, head=motion.head)
    (session / "hurt.wav").write_bytes(b"RIFF")
    (session / "hurt.npz").write_bytes(b"PK")
    out = python(
        """
        import os, sys
        from functools import partial
        from pathlib import Path
        from facesynth.corpus import Corpus
        from facesynth.corpus.add import add
        from facesynth.corpus.workers import Workers, spread

        alone = add(Corpus.open(sys.argv[1]), [sys.argv[3]])
        rays = add(Corpus.open(sys.argv[2]), [sys.argv[3]], workers=Workers(2, "ray"))
        assert (alone.added, set(alone.refused)) == (rays.added, set(rays.refused)), (alone, rays)
        print(len(rays.added), *rays.refused)

        def negative(number, marker):
            if number == 3 and not Path(marker).exists():
                Path(marker).touch()
                os._exit(9)
            return -number

        print(list(spread(partial(negative, marker=sys.argv[4]), range(8), Workers(2, "ray"), "negating")))
        """,
        new(tmp_path / "alone"),
        new(tmp_path / "rays"),
        session,
        tmp_path / "marker",
    )
    assert tuple(out.splitlines()) == ("6 hurt", str([-n for n in range(8)]))
    assert (tmp_path / "marker").exists()
    alone, rays = contents(tmp_path / "alone"), contents(tmp_path / "rays")
    assert {name for name in alone if name[0] != "."} == {name for name in rays if name[0] != "."}
    assert all(alone[name] == rays[name] for name in alone)
