"""Methods on a few long takes, compared block by block: known answers."""

import runpy

import numpy as np
import pytest
from corpora import tiny_layout

from facesynth.inference.motion import Motion

FPS = 10


@pytest.fixture(scope="module")
def takes(repository):
    return runpy.run_path(str(repository / "benchmarks" / "takes.py"))


def still(seconds, off_mm):
    """A face that is off by so much to the left in each of its seconds."""
    frames = np.zeros((seconds * FPS, len(tiny_layout().names), 3), np.float32)
    frames[:, :, 0] = np.repeat(off_mm, FPS)[:, None]
    return Motion(frames.reshape(len(frames), -1), FPS, tiny_layout())


def test_a_block_has_the_lip_error_of_its_frames_and_the_last_one_has_the_rest(takes):
    truth, mine = {"a": still(12, np.zeros(12))}, {"a": still(12, [1] * 5 + [3] * 5 + [10] * 2)}
    assert takes["blocks"](mine, truth, 5)["a"] == pytest.approx([1, (3 * 5 + 10 * 2) / 7])
    assert takes["blocks"](mine, truth, 60)["a"] == pytest.approx([(5 + 15 + 20) / 12])


def test_what_is_nearer_in_every_block_is_told_apart_and_equals_are_not(takes, capsys):
    away = np.linspace(1, 2, 12)
    first, second = ({"a": away[:6] + more, "b": away[6:] + more} for more in (0.0, 0.25))
    takes["compare"]("beside the first: more by", {"second": (second, first), "itself": (first, first)})
    told = {line.split(":")[0]: line for line in capsys.readouterr().out.splitlines() if line.startswith("- ")}
    assert "+0.2500, farther in 12 and nearer in 0 of 12 blocks, p = 0.00098;" in told["- second"]
    assert "by take +0.2500 (6 of 6), +0.2500 (6 of 6)" in told["- second"]
    assert "+0.0000, farther in 0 and nearer in 0 of 12 blocks, p = 1;" in told["- itself"]


def test_blocks_that_say_what_the_next_one_is_are_seen(takes):
    slow, quick = np.repeat([0.0, 1.0], 20), np.tile([0.0, 1.0], 20)
    assert takes["following"]({"a": slow}) > 0.9
    assert takes["following"]({"a": quick}) < -0.9
