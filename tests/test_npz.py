"""NPZ files that are damaged, or a stranger's."""

import zipfile
from functools import partial

import numpy as np
import pytest

from facesynth.inference import npz
from facesynth.inference.errors import FacesynthError
from facesynth.inference.npz import read_all_arrays, read_arrays, view_arrays


@pytest.fixture
def path(tmp_path):
    np.savez(tmp_path / "a.npz", a=np.arange(12).reshape(3, 4), b=np.float64(2.5), c=np.asfortranarray(np.ones((2, 3))))
    return tmp_path / "a.npz"


def test_what_is_asked_for_comes_back(path):
    assert sorted(read_arrays(path, "a file", ["a"])) == ["a"]
    assert sorted(read_arrays(path, "a file", ["a"], ["b", "z"])) == ["a", "b"]
    assert sorted(read_all_arrays(path, "a file")) == ["a", "b", "c"]
    views = view_arrays(path.read_bytes(), "abc")
    for name, array in read_all_arrays(path, "a file").items():
        np.testing.assert_array_equal(views[name], array)
        assert not views[name].flags.writeable


def test_what_is_missing_is_named(path):
    with pytest.raises(FacesynthError, match=r"is not a file: it holds no array 'y', 'z'"):
        read_arrays(path, "a file", ["a", "y", "z"])
    with pytest.raises(FacesynthError, match="is missing"):
        read_all_arrays(path.with_name("none.npz"), "a file")
    np.save(path.with_name("alone.npy"), np.zeros(3))
    with pytest.raises(FacesynthError, match="one array without a name"):
        read_all_arrays(path.with_name("alone.npy"), "a file")


def test_nothing_is_unpickled_and_nothing_large_unpacked(path, monkeypatch):
    np.savez(path, a=np.array([{}], object))
    with pytest.raises(FacesynthError, match="damaged"):
        read_all_arrays(path, "a file")
    with pytest.raises(FacesynthError, match="objects"):
        view_arrays(path.read_bytes(), "a")
    np.savez_compressed(path, a=np.zeros(10**6))
    assert path.stat().st_size < 20_000
    monkeypatch.setattr(npz, "LARGEST_BYTES", 10**6)
    with pytest.raises(FacesynthError, match=r"would unpack to 0\.0 GB"):
        read_all_arrays(path, "a file")


def test_bytes_changed_at_random_end_in_one_line_or_in_arrays(path):
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    for _ in range(400):
        hurt = bytearray(whole)
        for at in rng.integers(0, len(whole), 3):
            hurt[at] = rng.integers(256)
        path.write_bytes(hurt)
        for read, source in ((partial(read_all_arrays, what="a file"), path), (partial(view_arrays, names="abc"), bytes(hurt))):
            try:
                read(source)
            except FacesynthError as error:
                assert "\n" not in str(error)


def test_a_cut_file_is_damaged(path):
    whole = path.read_bytes()
    for length in (0, 1, 30, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(FacesynthError, match="damaged"):
            read_all_arrays(path, "a file")


def test_a_compressed_file_has_no_views(path):
    np.savez_compressed(path, a=np.zeros(3))
    with pytest.raises(FacesynthError, match="compressed"):
        view_arrays(path.read_bytes(), "a")
    assert zipfile.is_zipfile(path)
