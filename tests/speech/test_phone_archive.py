import struct

import numpy as np
import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.speech import phone_archive
from facesynth.speech.phone_archive import unpacked


def packed(arrays):
    """An archive as `unpacked` reads it: header, table, arrays on multiples of 16 bytes."""
    kinds = {"float32": 0, "float16": 1}
    table, body = b"", b""
    for name, array in arrays.items():
        table += struct.pack("<H", len(name)) + name.encode() + struct.pack("<BB", kinds[str(array.dtype)], array.ndim)
        table += struct.pack(f"<{array.ndim}I", *array.shape) + struct.pack("<QQ", len(body), array.nbytes)
        body += array.tobytes() + bytes(-array.nbytes % 16)
    head = b"HAMAPK" + struct.pack("<BBI", 1, 0, len(arrays)) + table
    return head + bytes(-len(head) % 16) + body


ARRAYS = {"weight": np.arange(6, dtype=np.float16).reshape(2, 3), "bias": np.array([0.5, -1.0, 2.0], np.float32)}


def test_an_archive_gives_its_arrays():
    found = unpacked(packed(ARRAYS))
    assert found.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert found[name].dtype == np.float32
        np.testing.assert_array_equal(found[name], array)


@pytest.mark.parametrize("damage", [lambda c: c[:-20], lambda c: c[:20], lambda c: b"RIFF" + c, lambda c: b""])
def test_a_damaged_archive_is_one_line(damage):
    with pytest.raises(FacesynthError, match="no archive of weights") as caught:
        unpacked(damage(packed(ARRAYS)))
    assert "\n" not in str(caught.value)


def test_a_changed_file_is_refused(monkeypatch, tmp_path):
    changed = tmp_path / phone_archive.WEIGHTS
    changed.write_bytes(packed(ARRAYS))
    monkeypatch.setattr(phone_archive, "_installed_file", lambda name: changed)
    with pytest.raises(FacesynthError, match=r"sha256 differs.*install hama==1.7.0"):
        phone_archive.read_archive()


def test_a_missing_distribution_says_what_to_install(monkeypatch):
    def files(_name):
        raise phone_archive.metadata.PackageNotFoundError

    monkeypatch.setattr(phone_archive.metadata, "files", files)
    assert not phone_archive.is_installed()
    with pytest.raises(FacesynthError, match="pip install hama==1.7.0"):
        phone_archive.read_archive()
