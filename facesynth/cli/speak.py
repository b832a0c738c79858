"""`facesynth speak`."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.feeling import AUTO, account, asks_to_listen, feeling_options, mapping, spoken_feeling
from facesynth.cli.own_rig import as_arkit, own_head, own_rig_options
from facesynth.cli.recordings import recordings
from facesynth.cli.targets import plan_targets, require_free, write_phones
from facesynth.inference.errors import FacesynthError, unknown

if TYPE_CHECKING:
    from facesynth.methods.anime_graph.method import AnimeGraph
    from facesynth.methods.efase.method import Efase
    from facesynth.methods.method import Method
    from facesynth.speech.hearing import Heard

BROADCAST = {"23.976": Fraction(24000, 1001), "29.97": Fraction(30000, 1001), "59.94": Fraction(60000, 1001)}


class Gain(click.ParamType):
    """`off` or a factor."""

    name = "off|gain"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """A number that is not negative."""
        try:
            gain = 0.0 if value == "off" else float(value)
        except ValueError:
            gain = -1.0
        if not 0 <= gain < float("inf"):
            self.fail(f"wanted off or a factor such as 0.5; got {value!r}", param, ctx)
        return gain


class Fps(click.ParamType):
    """A frame rate; 23.976, 29.97 and 59.94 mean the broadcast fractions."""

    name = "fps"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Fraction:
        """An exact fraction."""
        try:
            fps = BROADCAST.get(str(value)) or Fraction(str(value)).limit_denominator(100000)
        except (ValueError, ZeroDivisionError):
            fps = Fraction(0)
        if not 1 <= fps <= 1000:
            self.fail(f"wanted a rate from 1 to 1000 such as 30, 23.976 or 30000/1001; got {value!r}", param, ctx)
        return fps


@click.command("speak")
@click.argument("model", type=click.Path(path_type=Path))
@click.argument("speech", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    required=True,
    type=click.Path(path_type=Path),
    help="File to write: .mp4 .csv .glb .npz .bvh; several may be given. {name} stands for the name of the speech file.",
)
@click.option("--text", help="What is said.")
@click.option("--text-file", type=click.Path(path_type=Path), help="The same, from a file.")
@click.option("--phones", type=click.Path(path_type=Path), help="TextGrid, or lines of `end label`.")
@click.option("--emotion", help="One emotion for everything; `auto`: the one heard in the voice.")
@click.option(
    "--emotions",
    type=click.Path(path_type=Path),
    help="Emotion over time: CSV, or lines of `end emotion`; `auto`: as heard in the voice.",
)
@click.option("--intensity", type=click.FloatRange(0, 1), default=1.0, show_default=True, help="Of --emotion; 0 is neutral.")
@feeling_options
@click.option(
    "--constraints",
    type=click.Path(path_type=Path),
    help="CSV of nodes that must be used: phone_index or time_s, utterance_id, phone_number.",
)
@click.option("--fps", type=Fps(), default="30", show_default=True, help="Frame rate of what is written.")
@click.option("--head", type=Gain(), default="1", show_default=True, help="off, or a factor on head motion.")
@click.option("--eyes", type=Gain(), default="1", show_default=True, help="off, or a factor on gaze.")
@click.option("--size", default="1280x720", show_default=True, help="Of the video.")
@own_rig_options
@click.option(
    "--deform",
    type=click.Choice(["shapes", "distance", "regions"]),
    default="shapes",
    show_default=True,
    help="What moves the skin in videos: the solved shapes, or the markers, by distance along the skin or by regions.",
)
@click.option("--look-ahead", type=click.IntRange(min=1), help="anime_graph: search so many phones ahead, as for streaming.")
@click.option("--explain", type=click.Path(path_type=Path), help="Write why each phone got its node (JSON).")
@click.option("--noise", type=click.FloatRange(min=0), help="lds: amount of random motion; 1 as recorded, 0 none.")
@click.option(
    "--pictures",
    type=click.Choice(["coherent", "nearest"]),
    default="coherent",
    show_default=True,
    help="Real face: recorded pictures that follow each other well, or simply the nearest.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def speak(*, model: Path, speech: tuple[Path, ...], as_json: bool, **options: Any) -> None:
    """Turn SPEECH, files or folders of them, into a talking face.

    A transcript (clip.txt) or phones (clip.TextGrid) beside a sound file are used where none are given.
    """
    from facesynth.methods.registry import load
    from facesynth.stage.performance import check_output

    outputs = [check_output(path) for path in options["outputs"]]
    paths = recordings(speech)
    if len(paths) > 1:
        _require_batch(outputs, options)
    plan = plan_targets(paths, outputs, [path for path in speech if path.is_dir()], _read_files(model, options))
    if options["explain"]:
        require_free(options["explain"], [*paths, *_read_files(model, options)])
    size = parse_size(options["size"])
    method = load(model)
    _check_feeling(method, options)
    options["face_of"] = model
    if len(paths) == 1:
        result = _speak_one(method, paths[0], plan[paths[0]], size, options)
        click.echo(json.dumps(result) if as_json else "", nl=as_json)
        return
    _speak_all(method, plan, size, options, as_json)


def _read_files(model: Path, options: dict[str, Any]) -> list[Path]:
    """What is read beside the speech: the model, its speaker's pictures, and every file that was given."""
    given = [value for name, value in options.items() if isinstance(value, Path) and name not in ("explain", "face_of")]
    parts = [path for folder in given if folder.is_dir() for path in sorted(folder.iterdir())]
    return [model, model.with_name(f"{model.stem}.face.npz"), *given, *parts]


def _speak_all(
    method: Method, plan: dict[Path, list[Path]], size: tuple[int, int], options: dict[str, Any], as_json: bool
) -> None:
    """One after the other; what fails is told and passed over, and the command ends in an error after the last."""
    results, failed = [], []
    for path, targets in plan.items():
        try:
            results.append(_speak_one(method, path, targets, size, options))
        except FacesynthError as error:
            click.echo(f"error: {error}", err=True)
            failed.append(path.name)
    if as_json:
        click.echo(json.dumps(results))
    if failed:
        raise FacesynthError(f"{len(failed)} of {len(plan)} recordings were not spoken: {', '.join(failed)}")


def _check_feeling(method: Method, options: dict[str, Any]) -> None:
    if options["emotions"] and options["emotion"]:
        raise FacesynthError("both --emotion and --emotions were given; give one")
    if options["emotions"] and str(options["emotions"]) != AUTO and options["intensity"] != 1:
        raise FacesynthError("--intensity weakens --emotion; in --emotions each line has an intensity of its own")
    if options["emotion"] not in (None, AUTO, *method.emotions):
        raise unknown("emotion", options["emotion"], method.emotions)


def _speak_one(method: Method, path: Path, targets: list[Path], size: tuple[int, int], options: dict[str, Any]) -> dict[str, Any]:
    from facesynth.atomic import write_text
    from facesynth.face.rig.arkit_rig import load_head
    from facesynth.motion.planar import is_tracked
    from facesynth.stage.performance import Stage, perform, write_performance

    heard = _hear(path, method, options)
    for warning in heard.warnings:
        click.echo(f"warning: {path.name}: {warning}", err=True)
    settings = _method_options(method, heard, options)
    if is_tracked(method.fitted_layout):
        return _show_likeness(method, heard, path, targets, settings, options)
    rig = load_head()
    stage = Stage(float(options["fps"]), options["head"], options["eyes"], options["seed"], options["deform"])
    own = own_head(options)
    change = as_arkit(method, own, options, mapping(method, heard.speech, options))
    performance = perform(method, heard.speech, rig, stage, settings, change)
    found = account(method, heard.speech, settings)
    written = []
    if options["explain"]:
        write_text(options["explain"], json.dumps(_explaining(method).explain(heard.speech, **settings), indent=1))
        written.append(str(options["explain"]))
    for target in targets:
        write_performance(target, performance, own or rig, size)
        click.echo(f"{target}: {heard.speech.duration_s:.2f} s at {float(options['fps']):.5g} fps", err=True)
    written += [str(target) for target in targets]
    grid = targets[0].with_suffix(".TextGrid")
    if heard.source in ("transcript", "recognition") and write_phones(grid, heard):
        written.append(str(grid))
    return {"speech": str(path), "duration_s": heard.speech.duration_s, "phones": heard.source, "written": written, **found}


def _show_likeness(
    method: Method, heard: Heard, path: Path, targets: list[Path], settings: dict[str, Any], options: dict[str, Any]
) -> dict[str, Any]:
    """The speaker's real face, for a model of points followed in video; at the rate and size of the speaker's pictures."""
    from facesynth.corpus.signals import write_motion
    from facesynth.stage.likeness import load_face, write_likeness

    for target in targets:
        if target.suffix.lower() not in (".mp4", ".npz"):
            raise FacesynthError(
                f"a model of points in a picture has no head for {target.suffix}; write .mp4 (the real face) or .npz"
            )
    _warn_of_idle_options()
    speaker = load_face(options["face_of"], method)
    motion, change = method.synthesize(heard.speech, seed=options["seed"], **settings), mapping(method, heard.speech, options)
    motion = change(motion) if change else motion
    facts: dict[str, Any] = {"speech": str(path), "duration_s": heard.speech.duration_s, "written": list(map(str, targets))}
    for target in targets:
        if target.suffix.lower() == ".npz":
            write_motion(target, motion)
            continue
        report = write_likeness(target, motion, heard.speech, speaker, options["pictures"])
        facts |= {"real_time_factor": report.real_time_factor, "folded_triangles": report.folded_triangles, "jumps": report.jumps}
        click.echo(
            f"{target}: {heard.speech.duration_s:.2f} s at {speaker.fps:.5g} fps; real-time factor of the drawing"
            f" {report.real_time_factor:.2f}, folded triangles {report.folded_triangles}, jumps between pictures {report.jumps}",
            err=True,
        )
    return facts


def _warn_of_idle_options() -> None:
    """A real face keeps the rate and the size of its pictures, and the head that is in them."""
    context = click.get_current_context()
    given = [f"--{name}" for name in ("fps", "size", "head", "eyes") if _was_given(context, name)]
    if given:
        click.echo(f"warning: {', '.join(given)}: a real face keeps the rate, size, head and eyes of its pictures", err=True)


def _was_given(context: click.Context, name: str) -> bool:
    return context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE


def _hear(path: Path, method: Method, options: dict[str, Any]) -> Heard:
    try:
        return _heard(path, method, options)
    except FacesynthError as error:
        raise error if path.name in str(error) else FacesynthError(f"{path}: {error}") from None


def _heard(path: Path, method: Method, options: dict[str, Any]) -> Heard:
    from facesynth.speech.hearing import hear

    text, phones = _given_text(options), options["phones"]
    if text is None and phones is None:
        phones = next((p for p in [path.with_suffix(".TextGrid")] if p.exists()), None)
    if text is None and phones is None and path.with_suffix(".txt").exists():
        text = _read_text(path.with_suffix(".txt"))
    if asks_to_listen(options):
        heard = hear(path, text=text, phones_path=phones)
        return replace(heard, speech=spoken_feeling(heard.speech, method, options["face_of"], options))
    emotion = options["emotion"] or (None if options["emotions"] else method.emotions[0])
    feeling = {"emotion": emotion, "emotions_path": options["emotions"], "intensity": options["intensity"]}
    return hear(path, text=text, phones_path=phones, **feeling)


def _method_options(method: Method, heard: Heard, options: dict[str, Any]) -> dict[str, Any]:
    if options["explain"]:
        _explaining(method)
    if options["look_ahead"] is not None:
        if method.name != "anime_graph":
            raise FacesynthError(f"{method.name} always searches the whole utterance; --look-ahead is for anime_graph")
        return {"look_ahead": options["look_ahead"]}
    if options["noise"] is not None:
        if method.name != "lds":
            raise FacesynthError(f"{method.name} draws no noise; --noise is for lds")
        return {"noise": options["noise"]}
    if not options["constraints"]:
        return {}
    if method.name != "efase":
        raise FacesynthError(f"{method.name} has no nodes to constrain; efase has")
    from facesynth.methods.efase.constraints import read_constraints

    return {"constraints": read_constraints(options["constraints"], heard.speech.phones)}


def _explaining(method: Method) -> Efase | AnimeGraph:
    from facesynth.methods.anime_graph.method import AnimeGraph
    from facesynth.methods.efase.method import Efase

    if not isinstance(method, Efase | AnimeGraph):
        raise FacesynthError(f"{method.name} has no nodes to explain; efase and anime_graph have")
    return method


def _given_text(options: dict[str, Any]) -> str | None:
    if options["text"] is not None and options["text_file"] is not None:
        raise FacesynthError("both --text and --text-file were given; give one")
    return _read_text(options["text_file"]) if options["text_file"] else options["text"]


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise FacesynthError(f"{path}: cannot read the transcript ({error})") from None


def _require_batch(outputs: list[Path], options: dict[str, Any]) -> None:
    if any("{name}" not in str(output) for output in outputs):
        raise FacesynthError("several recordings need {name} in every output, such as -o 'out/{name}.mp4'")
    for key in ("text", "text_file", "phones", "constraints", "explain"):
        if options[key]:
            raise FacesynthError(
                f"--{key.replace('_', '-')} belongs to one recording; put clip.txt or clip.TextGrid beside each sound"
            )


def parse_size(text: str) -> tuple[int, int]:
    """Width and height from `1280x720`; both even, as H.264 wants them."""
    width, _, height = text.partition("x")
    if (
        not (width.isdigit() and height.isdigit())
        or not 32 <= min(int(width), int(height)) <= max(int(width), int(height)) <= 4096
    ):
        raise FacesynthError(f"--size wants WIDTHxHEIGHT from 32 to 4096, such as 1280x720; got {text!r}")
    if int(width) % 2 or int(height) % 2:
        raise FacesynthError(f"--size must be even in both directions for H.264; got {text!r}")
    return int(width), int(height)
