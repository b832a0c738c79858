"""`facesynth studio`."""

import webbrowser
from pathlib import Path

import click

FILE = click.Path(path_type=Path)


@click.command("studio")
@click.argument("corpus", type=FILE)
@click.argument("model", type=FILE, required=False)
@click.option("--project", type=FILE, help="Folder that the work is kept in; CORPUS-studio in this folder otherwise.")
@click.option("--rig", type=FILE, help="Head that is shown, as `speak` takes it; the built-in one otherwise.")
@click.option("--mapping", type=FILE, help="Which of the head's channels follow which ARKit weights, as `speak` takes it.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Of this computer; a free one otherwise.")
@click.option("--no-browser", is_flag=True, help="Print the address, and leave opening it to you.")
def studio(
    *, corpus: Path, model: Path | None, project: Path | None, rig: Path | None, mapping: Path | None, port: int, no_browser: bool
) -> None:
    """Work on what a model says, in the browser: timeline, face, map of phones and recordings of CORPUS.

    Nobody but this computer can reach it, and only with the address that is printed. Everything is kept as it is done;
    Ctrl-C ends it.
    """
    from facesynth.studio.serve import serve

    def opened(address: str) -> None:
        click.echo(f"the studio is at {address}", err=True)
        if not no_browser:
            webbrowser.open(address)

    folder = project or Path(f"{corpus.resolve().name}-studio")
    serve(folder, corpus, model, port=port, rig=rig, mapping=mapping, opened=opened)
