"""Patch-based sampling: known signals come back, joints are as smooth as recordings, what gets stuck is counted."""

import numpy as np
import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.inference.patches import PatchSettings, PatchTexture

SETTINGS = PatchSettings(patch=20, boundary=5, tolerance=0.2)


def texture(frames, settings=SETTINGS, starts=(0,)):
    return PatchTexture(frames, np.array(starts), settings)


def wave(count, period=16):
    turn = 2 * np.pi * np.arange(count) / period
    return np.stack([np.sin(turn), np.cos(turn)], axis=1)


def test_a_periodic_signal_is_reproduced():
    grown = texture(wave(160)).grow(400, np.random.default_rng(0))
    phase = np.unwrap(np.arctan2(grown.frames[:, 0], grown.frames[:, 1]))
    assert np.allclose(np.hypot(*grown.frames.T), 1, atol=0.05)
    assert np.allclose(np.diff(phase), 2 * np.pi / 16, atol=0.08)


def test_every_frame_is_recorded_or_lies_between_two_that_are():
    rng = np.random.default_rng(1)
    recorded = np.cumsum(rng.standard_normal((300, 3)), axis=0)
    grown = texture(recorded).grow(90, rng)
    patch, zone = SETTINGS.patch, SETTINGS.boundary
    for k, place in enumerate(grown.places[1:], start=1):
        at = patch + (k - 1) * (patch - zone)
        inside = recorded[place + zone : place + patch - zone]  # the last frames of a patch fade into the next
        assert np.array_equal(grown.frames[at : at + len(inside)], inside[: max(0, 90 - at)])


def test_no_patch_crosses_from_one_recording_into_the_next():
    frames = np.concatenate([wave(50), 10 + wave(50)])
    grown = texture(frames, starts=(0, 50)).grow(300, np.random.default_rng(2))
    assert all(place + SETTINGS.patch <= 50 or place >= 50 for place in grown.places)
    assert grown.frames.max() < 2 or grown.frames.min() > 8


def test_the_literal_distance_decides_who_qualifies():
    rng = np.random.default_rng(3)
    frames = rng.standard_normal((200, 2)) * (1, 5)
    own = texture(frames, PatchSettings(12, 3, 0.9))
    end = own._scaled[40:43]
    variance = frames.var(axis=0, ddof=1)
    literal = []
    for place in own.candidates:
        zone = [((frames[place + k] - frames[40 + k]) ** 2 / variance).sum() for k in range(3)]
        own_size = [(frames[40 + k] ** 2 / variance).sum() for k in range(3)]
        if np.sqrt(np.mean(zone)) < 0.9 * np.sqrt(np.mean(own_size)):
            literal.append(place)
    drawn = {own._next(end, np.random.default_rng(seed)) for seed in range(300)}
    assert {count for _, count in drawn} == {len(literal)}
    assert {place for place, _ in drawn} <= set(literal)


def test_a_resting_signal_gets_stuck_and_says_so():
    frames = np.zeros((60, 1))
    frames[50:] = 1.0
    grown = texture(frames).grow(200, np.random.default_rng(0))
    assert grown.stuck > 0
    assert np.isfinite(grown.frames).all()


def test_the_same_seed_gives_the_same_signal():
    frames = np.random.default_rng(5).standard_normal((300, 3)).cumsum(axis=0)
    first, again = (texture(frames).grow(250, np.random.default_rng(9)) for _ in range(2))
    assert np.array_equal(first.frames, again.frames)
    assert not np.array_equal(first.frames, texture(frames).grow(250, np.random.default_rng(8)).frames)


@pytest.mark.parametrize(("settings", "count"), [(PatchSettings(20, 20, 0.2), 100), (SETTINGS, 12)])
def test_what_cannot_grow_is_refused(settings, count):
    with pytest.raises(FacesynthError, match="patch"):
        texture(wave(count), settings)
