"""`facesynth studio`."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

import click

from facesynth.cli.types import FILE
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from facesynth.inference.speech import Speech
    from facesynth.speech.segments import Segment


@click.command("studio")
@click.argument("corpus", type=FILE, required=False)
@click.argument("model", type=FILE, required=False)
@click.option("--project", type=FILE, help="Folder that the work is kept in; CORPUS-studio in this folder otherwise.")
@click.option("--demo", is_flag=True, help="With the built-in performer, who is built first: nothing else is needed.")
@click.option("--rig", type=FILE, help="Head that is shown, as `speak` takes it; the built-in one otherwise.")
@click.option("--mapping", type=FILE, help="Which of the head's channels follow which ARKit weights, as `speak` takes it.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Of this computer; a free one otherwise.")
@click.option("--no-browser", is_flag=True, help="Print the address, and leave opening it to you.")
def studio(
    *,
    corpus: Path | None,
    model: Path | None,
    project: Path | None,
    demo: bool,
    rig: Path | None,
    mapping: Path | None,
    port: int,
    no_browser: bool,
) -> None:
    """Work on what a model says, in the browser: timeline, face, map of phones and recordings of CORPUS.

    Nobody but this computer can reach it, and only with the address that is printed. Everything is kept as it is done;
    Ctrl-C ends it.
    """
    from facesynth.studio.serve import serve

    lines: dict[str, tuple[Speech, Sequence[Segment]]] = {}
    if demo:
        if corpus or model:
            raise FacesynthError("--demo brings a corpus and a model; leave yours out")
        corpus, model, lines = _built_in()
    elif corpus is None and project is None:
        raise FacesynthError("give the CORPUS to work with, the --project to go on with, or --demo for the built-in performer")
    folder = project or Path(f"{'demo' if demo or corpus is None else corpus.resolve().name}-studio")

    def opened(address: str) -> None:
        click.echo(f"the studio is at {address}", err=True)
        if not no_browser:
            webbrowser.open(address)

    serve(folder, corpus, model, port=port, rig=rig, mapping=mapping, lines=lines, opened=opened)


def _built_in() -> tuple[Path, Path, dict[str, tuple[Speech, Sequence[Segment]]]]:
    """The built-in performer's corpus, a model of it, and a line that neither has heard."""
    from facesynth.cli.demo import demo_speech, trained_model
    from facesynth.performer.build import build_performer

    corpus = build_performer("small")
    trained, _ = trained_model(corpus, 0)
    if trained.path is None:
        raise TypeError("the demo's model was not saved")
    return corpus.path, trained.path, {"three-feelings": demo_speech(0)}
