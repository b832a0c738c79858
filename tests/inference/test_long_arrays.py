import mmap
import struct

import numpy as np
import pytest

from facesynth.inference import long_arrays
from facesynth.inference.ear import Ear
from facesynth.inference.errors import FacesynthError
from facesynth.inference.filters import at_rate, sharpen
from facesynth.inference.long_arrays import Growing, all_finite, by_blocks, copied, joined, let_go, loudest, row_blocks, zeros
from facesynth.inference.sound import resample


@pytest.fixture(params=[10**9, 100], ids=["in memory", "in a file"])
def sizes(request, monkeypatch):
    monkeypatch.setattr(long_arrays, "LARGE_BYTES", request.param)
    monkeypatch.setattr(long_arrays, "BLOCK_ROWS", 7)
    monkeypatch.setattr(long_arrays, "BLOCK_BYTES", 256)
    return request.param


def owner(values):
    while isinstance(values, np.ndarray | memoryview):
        values = values.base if isinstance(values, np.ndarray) else values.obj
    return values


def test_what_is_joined_is_the_whole_and_lies_in_a_file_where_it_is_large(sizes):
    parts = [np.full((k, 3), k, np.float32) for k in (4, 0, 9, 1)]
    whole = joined(parts)
    assert np.array_equal(whole, np.concatenate(parts))
    assert isinstance(owner(whole), mmap.mmap) == (sizes < whole.nbytes)
    whole[0] = 7
    let_go(whole[2:])
    assert (whole[0] == 7).all()
    assert np.array_equal(copied(whole), whole)


def test_nothing_has_the_shape_of_its_parts(sizes):
    assert Growing().add(np.zeros((0, 5))).whole().shape == (0, 5)
    assert joined([]).shape == (0,)
    assert zeros((40, 2)).sum() == 0


def test_blocks_cover_an_array_once(sizes):
    values = np.arange(50.0).reshape(25, 2)
    assert [k for rows in row_blocks(values) for k in range(25)[rows]] == list(range(25))
    assert np.array_equal(by_blocks(lambda some: some * 2, values, np.float64), values * 2)
    assert loudest(np.array([0.5, -2.0, 1.0])) == 2.0
    assert not all_finite(np.where(np.arange(100) == 99, np.nan, 0.0))


def test_filters_of_pieces_are_those_of_the_whole(sizes, monkeypatch):
    rng = np.random.default_rng(0)
    frames = rng.normal(size=(300, 5)).cumsum(axis=0)
    at = np.linspace(0, 299, 111)
    sound = rng.normal(size=9000).astype(np.float32)
    in_pieces = sharpen(frames, 0.8, 25.0), at_rate(frames, 60.0, 25.0, at), resample(sound, 44100, 16000)
    monkeypatch.undo()
    for got, wanted in zip(
        in_pieces, (sharpen(frames, 0.8, 25.0), at_rate(frames, 60.0, 25.0, at), resample(sound, 44100, 16000)), strict=True
    ):
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-12)


def test_a_sound_in_a_file_is_heard_as_one_in_memory(monkeypatch):
    def network(*, audio):
        frames = np.lib.stride_tricks.sliding_window_view(np.pad(audio[0], 160), 320)[::320].mean(axis=1)
        return [frames[None, :, None], frames[None, :, None, None]]

    sound = np.random.default_rng(0).uniform(-1, 1, 400_000).astype(np.float32)
    wanted = np.concatenate(list(Ear(network).read(sound)))
    monkeypatch.setattr(long_arrays, "LARGE_BYTES", 100)
    assert np.array_equal(np.concatenate(list(Ear(network).read(copied(sound)))), wanted)


def test_large_arrays_are_written_as_numpy_does_and_read_back_from_a_file(tmp_path, monkeypatch):
    from facesynth.inference import npz

    rng = np.random.default_rng(0)
    arrays = {"frames": rng.normal(size=(400, 9)).astype(np.float32), "fps": np.float64(30), "turned": rng.normal(size=(5, 70)).T}
    np.savez(tmp_path / "numpy.npz", **arrays)
    np.savez_compressed(tmp_path / "packed.npz", **arrays)
    for module in (long_arrays, npz):
        monkeypatch.setattr(module, "LARGE_BYTES", 1000)
    npz.write_arrays(tmp_path / "ours.npz", arrays)
    assert (tmp_path / "ours.npz").read_bytes() == (tmp_path / "numpy.npz").read_bytes()
    for name in ("ours.npz", "packed.npz"):
        found = npz.read_all_arrays(tmp_path / name, "arrays")
        assert all(np.array_equal(found[key], value) for key, value in arrays.items())
    damaged = bytearray((tmp_path / "ours.npz").read_bytes())
    damaged[4000] ^= 1
    (tmp_path / "ours.npz").write_bytes(damaged)
    with pytest.raises(FacesynthError, match="damaged"):
        npz.read_all_arrays(tmp_path / "ours.npz", "arrays")


def test_a_file_that_states_more_than_a_gigabyte_is_refused_before_anything_is_unpacked(tmp_path, monkeypatch):
    from facesynth.inference import npz

    path = tmp_path / "large.npz"
    np.savez(path, frames=np.zeros((10, 4), np.float32))
    content = bytearray(path.read_bytes())
    struct.pack_into("<I", content, content.index(b"PK\x01\x02") + 24, 2**31 - 1)  # what the list of contents states
    path.write_bytes(content)
    monkeypatch.setattr(npz.np, "load", None)
    with pytest.raises(FacesynthError, match=r"would unpack to 2\.1 GB"):
        npz.read_all_arrays(path, "a motion")
