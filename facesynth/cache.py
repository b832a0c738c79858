"""Where facesynth keeps what it made or fetched and can make or fetch again."""

import os
from pathlib import Path

import platformdirs


def cache_dir(name: str) -> Path:
    """The folder `name` in the user's cache (or in $FACESYNTH_CACHE), made if it is missing."""
    root = Path(os.environ.get("FACESYNTH_CACHE") or platformdirs.user_cache_dir("facesynth", appauthor=False))
    folder = root / name
    folder.mkdir(parents=True, exist_ok=True)
    return folder
