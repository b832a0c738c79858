"""A method of another package, installed beside facesynth, is known to every verb."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from corpora import tiny_corpus

from facesynth.cli import cli
from facesynth.corpus import Corpus
from facesynth.evaluation import jobs
from facesynth.face.files.npz import read_npz
from facesynth.inference.errors import FacesynthError
from facesynth.methods import registry
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid


@pytest.fixture(scope="module")
def installed(tmp_path_factory, repository):
    """The example as pip installs it, on the path."""
    folder = tmp_path_factory.mktemp("package")
    source = shutil.copytree(repository / "examples" / "third_party", folder / "source")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    done = subprocess.run(
        [*command, "--target", folder / "site", source], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder / "site")
        yield folder
    registry._CLASSES.pop("loud_face", None)
    sys.modules.pop("facesynth_loud_face", None)


@pytest.fixture(scope="module")
def shop(installed):
    """A corpus, a model that the command line trained, and a recording."""
    corpus = tiny_corpus(installed / "actor", utterances=12, fps=60)
    speech = corpus[corpus.ids[0]].speech
    save_wav(installed / "clip.wav", speech.audio, speech.sample_rate)
    write_textgrid(installed / "clip.TextGrid", speech.phones)
    said = ran("train", "loud_face", corpus.path, "window_s=0.05", "-o", installed / "loud_face.safetensors")
    assert "loud_face learned from 12 utterances" in said.stdout
    return installed


def ran(*arguments):
    result = CliRunner().invoke(cli, list(map(str, arguments)))
    assert result.exit_code == 0, result.output
    return result


@pytest.mark.usefixtures("installed")
def test_it_is_listed_with_its_own_option():
    assert "loud_face" in registry.list_methods()
    said = " ".join(ran("speak", "--help").stdout.split())
    assert "Options of loud_face: --liveliness" in said


def test_it_speaks_and_its_option_counts(shop):
    lively = {}
    for factor in (0, 1, 2):
        out = shop / f"{factor}.npz"
        ran("speak", shop / "loud_face.safetensors", shop / "clip.wav", "--liveliness", factor, "-o", out, "--head", "off")
        lively[factor] = np.ptp(read_npz(out)[1].frames, axis=0)
    assert (lively[0] == 0).all()
    assert lively[1].max() > 0
    np.testing.assert_allclose(lively[2], 2 * lively[1], rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--liveliness", 9), "liveliness"),
        (("--look-ahead", 2), "loud_face has no option --look-ahead; it is one of anime_graph"),
        (("--explain", "why.json"), "loud_face tells nothing of its choices"),
    ],
)
def test_what_it_cannot_do_is_refused_in_one_line(shop, option, message):
    arguments = ["speak", shop / "loud_face.safetensors", shop / "clip.wav", "-o", shop / "no.npz", *option]
    result = CliRunner().invoke(cli, list(map(str, arguments)))
    assert result.exit_code != 0
    assert message in f"{result.output} {result.exception}"
    assert not (shop / "no.npz").exists()


def test_it_refuses_a_corpus_without_recordings(shop):
    with pytest.raises(FacesynthError, match="no usable utterance"):
        registry.create("loud_face").fit(Corpus.open(shop / "actor").subset([]))


def test_it_is_compared(shop, monkeypatch):
    monkeypatch.setattr(jobs, "peak_speaking_mb", lambda *_: None)
    made = ran("evaluate", shop / "actor", "loud_face", "mean_face", "--folds", 2, "--no-references", "--no-video",
               "-o", shop / "report", "--json")  # fmt: skip
    assert {row["label"] for row in json.loads(made.stdout)["rows"]} == {"second take", "loud_face", "mean_face"}
