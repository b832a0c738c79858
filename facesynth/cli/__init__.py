"""The command line: `facesynth VERB …`. Verbs are imported when they are called, so that --help starts at once."""

import importlib
import signal
import sys
from collections.abc import Sequence

import click

from facesynth import __version__
from facesynth.inference.errors import FacesynthError
from facesynth.packages import missing

VERBS = {
    "demo": ("facesynth.cli.demo:demo", "Built-in performer: corpus, training, speech, video."),
    "corpus": ("facesynth.cli.corpus:corpus_group", "Make, fill and check a performer's recordings."),
    "train": ("facesynth.cli.train:train", "Train a method on a corpus."),
    "speak": ("facesynth.cli.speak:speak", "Turn speech into a talking face."),
    "studio": ("facesynth.cli.studio:studio", "Work on what a model says, in the browser."),
    "models": ("facesynth.cli.models:models", "List the models that can be used at once."),
    "retarget": ("facesynth.cli.retarget:retarget", "Put motion on any head, from a few frames posed by hand."),
    "emotion": ("facesynth.cli.emotion:emotion", "Hear the emotion in a voice."),
    "tune": ("facesynth.cli.tune:tune", "Search a method's settings on held-out sentences."),
    "fetch": ("facesynth.cli.fetch:fetch", "Download the head that is shown, and the models that find faces."),
    "export": ("facesynth.cli.export:export", "Write a model as ONNX graphs that run without torch."),
    "card": ("facesynth.cli.models:card", "Write what a model learned from, and under which licence."),
    "push": ("facesynth.cli.models:push", "Write a model into one file, for another place."),
    "pull": ("facesynth.cli.models:pull", "Keep a model from a file or URL, to be used by its name."),
    "evaluate": ("facesynth.cli.evaluate:evaluate", "Compare methods on sentences they did not see."),
    "reproduce": ("facesynth.cli.reproduce:reproduce", "A paper's figures beside ours, as far as they can be compared."),
    "doctor": ("facesynth.cli.doctor:doctor", "What is installed, what is missing, and what to do."),
}


class Verbs(click.Group):
    """Loads a verb's module only when that verb is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Verbs in the order of a newcomer's day."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command behind a verb."""
        if cmd_name not in VERBS:
            return None
        module, _, name = VERBS[cmd_name][0].partition(":")
        command: click.Command = getattr(importlib.import_module(module), name)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """One line for each verb, without importing any."""
        with formatter.section("Verbs"):
            formatter.write_dl([(verb, line) for verb, (_, line) in VERBS.items()])


@click.command(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="facesynth")
def cli() -> None:
    """Talking, feeling faces driven by speech, learned from recordings of one performer."""


def main() -> None:
    """Run the command line."""
    run(cli)


def run(command: click.Command, arguments: Sequence[str] | None = None, method: str | None = None) -> None:
    """Run a command, possibly for models of one method alone.

    It leaves with 0 when all is well, 2 with one line for wrong input, 1 with a traceback for a bug.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # being ended leaves no more behind than Ctrl-C does
    try:
        command.main(arguments, standalone_mode=False, obj=method)
    except FacesynthError as error:
        _leave(str(error))
    except click.ClickException as error:
        _leave(error.format_message())
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted; what was finished before is kept", err=True)
        sys.exit(130)
    except ImportError as error:
        if (said := missing(error)) is None:
            raise
        _leave(str(said))
    except OSError as error:
        _leave(f"{error.filename or ''}: {error.strerror or error}".lstrip(": "))


def _leave(message: str) -> None:
    click.echo("error: " + " ".join(message.split()), err=True)
    sys.exit(2)
