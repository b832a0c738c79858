"""`facesynth speak`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.options import as_json, seeded, show
from facesynth.cli.recordings import is_recording, recordings
from facesynth.cli.targets import plan_targets, require_free
from facesynth.cli.transcriber import chosen_transcriber
from facesynth.cli.types import FILE, Fps, Intensity, PartType, Size, type_of
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.methods.capabilities import Option
    from facesynth.stage.request import Request
    from facesynth.stage.speaking import Production


class WithMethodOptions(click.Command):
    """A command that has the own options of all known methods beside those that it states itself."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Its own, and the methods'."""
        return [*super().get_params(ctx), *self._brought()]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The options of every model, then those that are one method's own."""
        brought = self._brought()
        own = {option.name: option.get_help_record(ctx) for option in brought}
        general = [record for p in super().get_params(ctx) if isinstance(p, click.Option) and (record := p.get_help_record(ctx))]
        for title, records in [("Options", general), *_by_method({k: v for k, v in own.items() if k and v})]:
            with formatter.section(title):
                formatter.write_dl(records)

    def options_of_methods(self) -> tuple[dict[str, Option], list[str]]:
        """All methods' own options by name, and a line for each that is left out."""
        from facesynth.methods.registry import own_options

        flags = {flag.lstrip("-").replace("-", "_") for param in self.params for flag in (*param.opts, param.name or "")}
        return own_options({*flags, "help", "h"})

    def taken_apart(self, given: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """What was given: the command's own options, and the methods' own that were given."""
        names = self.options_of_methods()[0]
        own = {name: value for name, value in given.items() if name in names and value is not None}
        return {name: value for name, value in given.items() if name not in names}, own

    def _brought(self) -> list[click.Option]:
        options = self.options_of_methods()[0].values()
        return [click.Option([option.flag], type=type_of(option), help=option.help) for option in options]


def files_among(own: dict[str, Any]) -> list[str]:
    """Names of the methods' own options that are files, each of one recording."""
    return [name for name, value in own.items() if isinstance(value, Path)]


def _by_method(records: dict[str, tuple[str, str]]) -> list[tuple[str, list[tuple[str, str]]]]:
    from facesynth.methods.registry import known_capabilities

    rows = [
        (f"Options of {one.name}", [records[option.name] for option in one.options if option.name in records])
        for one in known_capabilities()[0]
    ]
    return [(title, own) for title, own in rows if own]


OF_ONE_RECORDING = ("text", "phones", "explain")


@click.command("speak", cls=WithMethodOptions)
@click.argument("given", nargs=-1, required=True, type=FILE, metavar="[MODEL] SPEECH...")
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    required=True,
    type=FILE,
    help="File to write: .mp4 .csv .glb .npz .bvh; several may be given. {name} stands for the name of the speech file.",
)
@click.option("--text", help="What is said.")
@click.option("--text-file", type=FILE, help="The same, from a file.")
@click.option("--phones", type=FILE, help="TextGrid, or lines of `end label`.")
@click.option("--speaker", help="Whose phones are taken, where a TextGrid holds those of several.")
@click.option("--language", help="Of the text, such as de or pt (ISO 639-1); found out otherwise.")
@click.option("--transcribe", is_flag=True, help="Let Whisper (`fetch whisper`) write down what is said, where nobody says it.")
@click.option("--transcriber", type=FILE, help="The same by the model of faster-whisper in this folder.")
@click.option("--emotion", help="One emotion for everything; `auto`: the one heard in the voice.")
@click.option("--emotions", type=FILE, help="Emotion over time: CSV, or lines of `end emotion`; `auto`: as heard in the voice.")
@click.option(
    "--intensity",
    type=Intensity(),
    default="1",
    show_default=True,
    help="Of --emotion, 0 is neutral; or a CSV of time_s,intensity.",
)
@click.option("--detector", type=FILE, help="Emotion detector for `auto`; otherwise emotion.safetensors beside the model.")
@click.option("--to-emotion", help="Map the motion to this emotion, by maps of the model or of --maps.")
@click.option("--to-intensity", type=click.FloatRange(0, 1), default=1.0, show_default=True, help="Of --to-emotion.")
@click.option("--maps", type=FILE, help="A model that learned maps between emotions, which --to-emotion uses.")
@click.option("--expression", type=FILE, help="A model of expressions, file or name: it adds emotions to a neutral mouth.")
@click.option("--fps", type=Fps(), show_default="30", help="Frame rate of what is written.")
@click.option("--head", type=PartType(), default="1", show_default=True, help="off, recorded alone, a factor, or a model.")
@click.option("--eyes", type=PartType(), default="1", show_default=True, help="off, recorded alone, a factor, or a model.")
@click.option(
    "--mouth",
    type=click.FloatRange(min=0),
    default=1.0,
    show_default=True,
    help="Factor on the movement of mouth and jaw; lips that are shut stay shut.",
)
@click.option("--size", type=Size(), show_default="1280x720", help="Of the video.")
@click.option(
    "--rig",
    type=FILE,
    help="Head that is shown: .glb, .gltf or .vrm with morph targets, or a folder of OBJ files; the built-in one otherwise.",
)
@click.option(
    "--mapping",
    type=FILE,
    help="YAML: which of the head's (or the model's) own channels follow which ARKit weights, or the name of a preset: "
    "cc3, cc4, daz, facs, meta, metahuman, mixamo, mmd, oculus, preston_blair, readyplayerme, rhubarb, sranipal, unified, vrm0, "
    "vrm1. NAME.yaml beside the head, or what fits best, otherwise.",
)
@click.option(
    "--deform",
    type=click.Choice(["shapes", "distance", "regions"]),
    default="shapes",
    show_default=True,
    help="What moves the skin in videos: the solved shapes, or the markers, by distance along the skin or by regions.",
)
@click.option("--explain", type=FILE, help="Write why each phone got its motion (JSON).")
@click.option(
    "--pictures",
    type=click.Choice(["coherent", "nearest"]),
    default="coherent",
    show_default=True,
    help="Real face: recorded pictures that follow each other well, or simply the nearest.",
)
@click.option("--device", default="auto", show_default=True, help="Where the model runs: auto, cpu, cuda or mps.")
@seeded
@as_json
def speak(
    *,
    given: tuple[Path, ...],
    outputs: tuple[Path, ...],
    text_file: Path | None,
    device: str,
    as_json: bool,
    **asked: Any,
) -> None:
    """Turn SPEECH, files or folders of them, into a talking face.

    MODEL is a model's file, a folder that `facesynth export` wrote, or a name that `facesynth models` lists; without one the
    face is that of the model that comes with facesynth for everybody's voice.
    A transcript (clip.txt) or phones (clip.TextGrid) beside a sound file are used where none are given.
    """
    from facesynth.methods.trained import on_device
    from facesynth.stage.performance import check_output
    from facesynth.stage.speaking import produce
    from facesynth.zoo.shelf import load

    for line in speak.options_of_methods()[1]:
        _tell(f"warning: {line}")
    request = _request(text_file, asked)
    model, speech = _model_and_speech(given)
    targets, paths = [check_output(path) for path in outputs], recordings(speech)
    if len(paths) > 1:
        _require_batch(targets, request)
    read = [*_read_files(model, request), *([text_file] if text_file else [])]
    plan = plan_targets(paths, targets, [path for path in speech if path.is_dir()], read)
    if request.explain:
        require_free(request.explain, [*paths, *read])
    production = produce(on_device(load(model), device), targets, request)
    if len(paths) > 1:
        _say_all(production, plan, as_json)
        return
    spoken = production.say(paths[0], plan[paths[0]], _tell)
    show(as_json, spoken.facts, [])


def _model_and_speech(given: tuple[Path, ...]) -> tuple[Path, tuple[Path, ...]]:
    """The model, which may be left out, and what is to be spoken."""
    from facesynth.zoo.shelf import DEFAULT, find, is_model

    first, rest = given[0], given[1:]
    if is_model(first) or (rest and not is_recording(first)):
        if not rest:
            raise FacesynthError(f"{first} is to speak, but nothing to be spoken was given; name a sound file")
        return find(first), rest
    return find(DEFAULT), given


def _request(text_file: Path | None, given: dict[str, Any]) -> Request:
    """Everything that was asked for, parsed once."""
    from facesynth.encoding import encoding_remark
    from facesynth.stage.listening import read_text
    from facesynth.stage.request import Request

    given["transcriber"] = chosen_transcriber(given.pop("transcribe"), given["transcriber"])
    asked, own = speak.taken_apart(given)
    if text_file is not None:
        if asked["text"] is not None:
            raise FacesynthError("both --text and --text-file were given; give one")
        asked |= {"text": read_text(text_file), "remarks": encoding_remark(text_file)}
    return Request(**asked, own=own)


def _read_files(model: Path, request: Request) -> list[Path]:
    """What is read beside the speech: the model, its speaker's pictures, and every file that was given."""
    asked = [value for name, value in {**vars(request), **request.own}.items() if name != "explain"]
    given = [value for value in asked if isinstance(value, Path)]
    given += [part.model for part in (request.head, request.eyes) if part.model is not None]
    parts = [path for folder in given if folder.is_dir() for path in sorted(folder.iterdir())]
    return [model, model.with_name(f"{model.stem}.face.npz"), *given, *parts]


def _say_all(production: Production, plan: dict[Path, list[Path]], as_json: bool) -> None:
    """One after the other; what fails is told and passed over, and the command ends in an error after the last."""
    results, failed = [], []
    for path, targets in plan.items():
        try:
            results.append(production.say(path, targets, _tell).facts)
        except FacesynthError as error:
            _tell(f"error: {error}")
            failed.append(path.name)
    show(as_json, results, [])
    if failed:
        raise FacesynthError(f"{len(failed)} of {len(plan)} recordings were not spoken: {', '.join(failed)}")


def _require_batch(outputs: Sequence[Path], request: Request) -> None:
    if any("{name}" not in str(output) for output in outputs):
        raise FacesynthError("several recordings need {name} in every output, such as -o 'out/{name}.mp4'")
    given = [name for name in OF_ONE_RECORDING if getattr(request, name) is not None]
    if given := [*given, *files_among(dict(request.own))]:
        flag = "--" + given[0].replace("_", "-")
        raise FacesynthError(f"{flag} belongs to one recording; put clip.txt or clip.TextGrid beside each sound")


def _tell(line: str) -> None:
    click.echo(line, err=True)
