"""Builds facesynth-runtime from facesynth's own folder, under a name of its own: one source, two distributions.

A source distribution carries a copy of that folder, so that it can be built anywhere.
"""

import atexit
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

from setuptools import setup
from setuptools.command.sdist import sdist

NAME = "facesynth_runtime"
HERE = Path(__file__).resolve().parent
PLACES = (HERE / NAME, HERE.parent.parent / "facesynth" / "inference")
SOURCE = next((place for place in PLACES if (place / "version.py").is_file()), None)
if SOURCE is None:
    sys.exit(
        f"{HERE} holds no source of facesynth-runtime: it is built from facesynth/inference, two folders up; "
        "build it inside of a checkout of facesynth, or from its source distribution"
    )


class SelfContained(sdist):
    """The source distribution, with the folder inside."""

    def make_release_tree(self, base_dir, files):
        """Leave out what lies elsewhere, and put the folder where setup.py looks first."""
        super().make_release_tree(base_dir, [name for name in files if not name.startswith("..") and not os.path.isabs(name)])
        shutil.copytree(SOURCE, Path(base_dir) / NAME, ignore=shutil.ignore_patterns("__pycache__"))


# Built in a folder of its own: what an earlier build left behind must not get into a wheel.
scratch = tempfile.mkdtemp()
atexit.register(shutil.rmtree, scratch, ignore_errors=True)

setup(
    version=re.search(r'__version__ = "(.+)"', (SOURCE / "version.py").read_text(encoding="utf-8")).group(1),
    packages=[".".join((NAME, *path.parent.relative_to(SOURCE).parts)) for path in sorted(SOURCE.rglob("__init__.py"))],
    package_dir={NAME: os.path.relpath(SOURCE, HERE)},
    cmdclass={"sdist": SelfContained},
    options={"build": {"build_base": scratch}, "egg_info": {"egg_base": scratch}},
)
