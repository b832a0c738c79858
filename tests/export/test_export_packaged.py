"""A model that comes with facesynth is exported by its name: its folder is copied."""

import pytest

from facesynth.cli import cli
from facesynth.inference.errors import FacesynthError
from facesynth.inference.folder import open_folder
from facesynth.zoo.shelf import PACKAGED


def exported(*arguments):
    return cli.main(["export", *map(str, arguments)], standalone_mode=False)


@pytest.mark.parametrize("name", ["grid-s1", "grid-s1-network", "eyes"])
def test_a_packaged_model_is_copied_by_its_name(tmp_path, name):
    exported(name, "-o", tmp_path / "out")
    packaged = open_folder(PACKAGED / name)
    assert open_folder(tmp_path / "out").manifest == packaged.manifest
    assert {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()} == packaged.contents | {
        p.name: p.read_bytes() for p in (PACKAGED / name).iterdir()
    }
    with pytest.raises(FacesynthError, match="is there and not empty"):
        exported(name, "-o", tmp_path / "out")


@pytest.mark.parametrize("option", [("--weights", "int8"), ("--beside", __file__)])
def test_it_is_not_changed_on_the_way(tmp_path, option):
    with pytest.raises(FacesynthError, match="comes exported"):
        exported("grid-s1", "-o", tmp_path / "out", *option)
    assert not list(tmp_path.iterdir())
