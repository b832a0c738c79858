"""A model in one file, to be carried to another place: a ZIP of its folder, checked before anything in it is used."""

import re
import shutil
import tempfile
import urllib.error
import urllib.request
import zipfile
from pathlib import Path
from urllib.parse import urlsplit

from facesynth.atomic import atomic_path
from facesynth.hashing import hash_file
from facesynth.inference.errors import FacesynthError
from facesynth.inference.folder import CARD, MANIFEST, open_folder, place_of
from facesynth.progress import track
from facesynth.zoo.shelf import Entry, entry_of, names, pulled_path

SUFFIX = ".facesynth.zip"
LARGEST_BYTES = 512 << 20
"""Of a parcel, and of what is in it."""
PIECE_BYTES = 1 << 20
PATIENCE_S = 60.0
_MOMENT = (1980, 1, 1, 0, 0, 0)
"""Of every file in a parcel, so that the same model gives the same bytes."""


def push(folder: Path, to: Path) -> tuple[Path, str]:
    """Write a model's folder, which must have a card, into one file in the folder `to`; returns it and its sha256."""
    model = entry_of(folder)
    target = to / f"{model.name}{SUFFIX}"
    with atomic_path(target) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as parcel:
        for name in sorted([*open_folder(folder).contents, MANIFEST, CARD]):
            parcel.writestr(zipfile.ZipInfo(name, _MOMENT), place_of(folder, name).read_bytes(), zipfile.ZIP_DEFLATED)
    return target, hash_file(target)


def pull(source: str, *, sha256: str | None = None) -> Entry:
    """Take a model out of a parcel, from a file or a URL that the user names, and keep it under its name.

    Nothing of it is run. FacesynthError where it does not arrive, has another sha256 than was given, is no parcel, holds a
    model whose files differ from its manifest, or has no card; and where a model of that name is there with other content.
    """
    with tempfile.TemporaryDirectory(prefix="facesynth-") as temporary:
        parcel = _fetched(source, Path(temporary)) if _is_url(source) else Path(source)
        if not parcel.is_file():
            raise FacesynthError(f"{parcel}: no such file; wanted a parcel NAME{SUFFIX} that `facesynth push` wrote, or its URL")
        if sha256 is not None and (got := hash_file(parcel)) != sha256.lower():
            raise FacesynthError(
                f"{source} has the sha256 {got}; wanted {sha256}: it was changed or is another one, and is not used"
            )
        name = Path(urlsplit(source).path if _is_url(source) else source).name.removesuffix(SUFFIX)
        if not re.fullmatch(r"[\w][\w.-]{0,63}", name):
            raise FacesynthError(f"{name!r} cannot be the name of a model; name the file such as actor{SUFFIX}")
        unpacked = Path(temporary) / name
        _unpack(parcel, unpacked)
        entry_of(unpacked)
        return entry_of(_kept(unpacked))


def _kept(unpacked: Path) -> Path:
    known = names()
    if (there := known.get(unpacked.name)) is not None:
        if open_folder(there).manifest["sha256"] == open_folder(unpacked).manifest["sha256"]:
            return there
        raise FacesynthError(
            f"there is another model called {unpacked.name} in {there}; remove it, or give the file another name"
        )
    target = pulled_path(unpacked.name)
    shutil.copytree(unpacked, part := target.with_name(f".part-{target.name}"), dirs_exist_ok=True)
    part.rename(target)
    return target


def _unpack(parcel: Path, folder: Path) -> None:
    """Plain files of one folder, as many bytes as they say and no more than a model may have."""
    try:
        with zipfile.ZipFile(parcel) as archive:
            members = archive.infolist()
            if sum(one.file_size for one in members) > LARGEST_BYTES:
                raise FacesynthError(f"{parcel.name} holds more than {LARGEST_BYTES >> 20} MB; that is no model of facesynth")
            folder.mkdir()
            for one in members:
                if Path(one.filename).name != one.filename or "\\" in one.filename or one.is_dir():
                    raise FacesynthError(
                        f"{parcel.name} names {one.filename!r}, which is not a file of this model; it is not used"
                    )
                (folder / one.filename).write_bytes(archive.read(one))
    except (OSError, zipfile.BadZipFile, zipfile.LargeZipFile, RuntimeError, NotImplementedError, EOFError) as error:
        raise FacesynthError(f"{parcel.name} is damaged or no parcel of a model ({error}); push or fetch it again") from None


def _is_url(source: str) -> bool:
    return "://" in source


def _fetched(url: str, folder: Path) -> Path:
    """The file behind a URL; FacesynthError where it does not arrive whole."""
    if urlsplit(url).scheme not in ("https", "http", "file"):
        raise FacesynthError(f"{url}: wanted a URL that begins with https:// or file://")
    target = folder / "parcel.zip"
    try:
        with urllib.request.urlopen(url, timeout=PATIENCE_S) as answer, target.open("wb") as file:  # noqa: S310 - checked above
            stated = int(answer.headers.get("Content-Length") or 0)
            for _ in track(range(LARGEST_BYTES // PIECE_BYTES), "fetching", -(-stated // PIECE_BYTES) or None):
                if not (piece := answer.read(PIECE_BYTES)):
                    break
                file.write(piece)
            else:
                raise FacesynthError(f"{url} is larger than {LARGEST_BYTES >> 20} MB; that is no model of facesynth")
    except (urllib.error.URLError, OSError, ValueError) as error:
        raise FacesynthError(f"{url} did not arrive ({error}); is there a network, and such a file?") from None
    if stated and target.stat().st_size != stated:
        raise FacesynthError(f"{url} broke off at {target.stat().st_size} of {stated} bytes; fetch it again")
    return target
