"""Microphone to phones to face in a page, and the same stream in Node: what the runtime's stream hears, with the network cut."""

import base64
import shutil
import subprocess
import sys

import numpy as np
import pytest
from pages import a_browser, colours, installed, said_by_node, visited

from facesynth.inference import load
from facesynth.inference.phones import BILABIALS
from facesynth.speech.audio import load_audio, resample, save_wav

RATE = 16000
TEXT = "My mother bought a puppy. Pat will bake more bread."
REPORT_S, WAIT_S = 4.0, 300


@pytest.fixture(scope="module")
def spoken(voice, tmp_path_factory):
    """A sound file of the built-in performer's voice, whose p, b and m are plain."""
    from facesynth.performer.voice import speak

    audio, rate = speak([TEXT])[0]
    path = tmp_path_factory.mktemp("spoken") / "speech.wav"
    save_wav(path, resample(np.pad(audio, (rate // 2, rate)), rate, RATE), RATE)
    return path


def heard(folder, sound):
    stream = load(folder).stream()
    return [*stream.push(load_audio(sound)[0]), *stream.finish()]


@pytest.mark.slow
@pytest.mark.parametrize("piece", [777, 100_000])
def test_node_hears_in_pieces_what_the_runtime_hears(spoken, piece, tmp_path):
    from facesynth.export.phones import export_phones

    export_phones(tmp_path / "hearing", "float16")
    got, wanted = said_by_node("hear.mjs", tmp_path / "hearing", spoken, piece), heard(tmp_path / "hearing", spoken)
    assert [phone["label"] for phone in got] == [phone.label for phone in wanted]
    np.testing.assert_allclose([phone["end_s"] for phone in got], [phone.end_s for phone in wanted], atol=1e-9)
    np.testing.assert_allclose([phone["confidence"] for phone in got], [phone.confidence for phone in wanted], atol=1e-3)


@pytest.mark.slow
def test_the_page_hears_a_microphone_and_moves_its_lips_without_a_network(spoken, tmp_path):
    browser, example = a_browser(), installed("browser")
    here = tmp_path / "page"
    shutil.copytree(example, here, ignore=shutil.ignore_patterns("site", "node_modules"))
    (here / "node_modules").symlink_to(example / "node_modules")
    subprocess.run([sys.executable, "make_live.py"], cwd=here, check=True, timeout=1800)
    subprocess.run([shutil.which("node"), "build.mjs"], cwd=here, check=True, timeout=1800)
    flags = ["--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream", "--autoplay-policy=no-user-gesture-required"]
    flags += [f"--use-file-for-fake-audio-capture={spoken}%noloop"]
    report = visited(browser, here / "site", tmp_path, f"live.html?report_s={REPORT_S}", flags, WAIT_S)
    assert "error" not in report, report
    phones, wanted = report["phones"], heard(here / "site" / "hearing", spoken)
    got = [phone["label"] for phone in phones if phone["label"] != "pau"]
    said = [phone.label for phone in wanted if phone.label != "pau"][: len(got)]
    assert len(got) > 20
    assert changed(got, said) <= 0.15 * len(said)  # the browser brings the sound to its own rate and back
    times_s, openings_mm = np.array(report["openings"]).T
    closures = middles(phones)
    assert len(closures[closures < REPORT_S]) > 5
    at = np.interp(closures[closures < REPORT_S], times_s, openings_mm)
    assert openings_mm.max() > 3
    assert at.max() < 0.3 * openings_mm.max()
    assert report["frames"] > 0
    picture = base64.b64decode(report["picture"].partition(",")[2])
    (tmp_path / "live.png").write_bytes(picture)
    assert colours(tmp_path / "live.png") > 100


def middles(phones):
    ends_s = np.array([phone["end_s"] for phone in phones])
    starts_s = np.concatenate([[0.0], ends_s[:-1]])
    return ((starts_s + ends_s) / 2)[[phone["label"] in BILABIALS for phone in phones]]


def changed(got, said):
    """Levenshtein distance."""
    row = np.arange(len(said) + 1)
    for k, one in enumerate(got, 1):
        before, row = row, [k]
        for j, other in enumerate(said, 1):
            row.append(min(before[j] + 1, row[-1] + 1, before[j - 1] + (one != other)))
    return row[-1]
