"""Options of the command line that concern emotions: heard in the voice, and mapped onto the motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
import numpy as np

from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.inference.motion import Motion
    from facesynth.inference.speech import EmotionTrack, Speech
    from facesynth.methods.anime_graph.method import AnimeGraph
    from facesynth.methods.emotion.detector import EmotionDetector
    from facesynth.methods.method import Method

AUTO = "auto"
BESIDE = "emotion.safetensors"
"""Name of the detector that is looked for beside a model."""

F = TypeVar("F", bound=Callable[..., Any])


def feeling_options(command: F) -> F:
    """The options of `speak` that `spoken_feeling` and `mapping` read."""
    for option in (
        click.option("--maps", type=click.Path(path_type=Path), help="An anime graph whose emotion maps --to-emotion uses."),
        click.option("--to-intensity", type=click.FloatRange(0, 1), default=1.0, show_default=True, help="Of --to-emotion."),
        click.option("--to-emotion", help="Map the motion to this emotion; the model, or --maps, is an anime graph."),
        click.option(
            "--detector",
            type=click.Path(path_type=Path),
            help=f"Emotion detector for `auto`; otherwise {BESIDE} beside the model.",
        ),
    ):
        command = option(command)
    return command


def asks_to_listen(options: dict[str, Any]) -> bool:
    """Whether the emotion is to be heard in the voice."""
    return AUTO in (options["emotion"], str(options["emotions"]))


def spoken_feeling(speech: Speech, method: Method, model: Path, options: dict[str, Any]) -> Speech:
    """Speech with the emotions heard in it: one (`--emotion auto`), or along time (`--emotions auto`)."""
    detector = _detector(options["detector"], model)
    known = [e for e in detector.emotions if e in method.emotions]
    if not known:
        raise FacesynthError(
            f"the detector hears {', '.join(detector.emotions)}; this model knows {', '.join(method.emotions)}: "
            "train a detector on this performer, or name the --emotion"
        )
    track = _heard(speech, detector, known, along=options["emotion"] != AUTO)
    felt = replace(track, intensities=np.full(len(track.labels), options["intensity"]))
    _tell(felt, detector, known)
    return replace(speech, emotions=felt)


def _detector(path: Path | None, model: Path) -> EmotionDetector:
    from facesynth.methods.emotion.detector import EmotionDetector

    beside = model.parent / BESIDE
    if path is None and not beside.is_file():
        raise FacesynthError(
            f"hearing the emotion needs a detector: give --detector, or put {BESIDE} beside the model; "
            "`facesynth train emotion CORPUS` makes one"
        )
    return EmotionDetector.load(path or beside)


def _heard(speech: Speech, detector: EmotionDetector, known: list[str], *, along: bool) -> EmotionTrack:
    """Emotions that both detector and model know; of the others, the most probable known one stands in."""
    from facesynth.inference.speech import EmotionTrack
    from facesynth.methods.emotion.detector import track_of

    if along:
        ends_s, probabilities = detector.along(speech.audio, speech.sample_rate)
        return track_of(ends_s, probabilities[:, [detector.emotions.index(e) for e in known]], known)
    reading = detector.detect(speech.audio, speech.sample_rate)
    best = max(known, key=lambda e: reading.probabilities[e])
    return EmotionTrack.constant(reading.emotion if reading.emotion in known else best, speech.duration_s)


def _tell(track: EmotionTrack, detector: EmotionDetector, known: list[str]) -> None:
    said = ", ".join(f"{label} to {end:.2f} s" for label, end in zip(track.labels, track.ends_s, strict=True))
    missing = sorted(set(detector.emotions) - set(known))
    note = f" (the model does not know {', '.join(missing)})" if missing else ""
    click.echo(f"heard: {said}{note}", err=True)


def mapping(method: Method, speech: Speech, options: dict[str, Any]) -> Callable[[Motion], Motion] | None:
    """What `--to-emotion` does to a motion; None where nothing was asked for."""
    target, amount = options["to_emotion"], options["to_intensity"]
    if target is None:
        if options["maps"]:
            raise FacesynthError("--maps belongs to --to-emotion; say which emotion")
        return None
    graph = _graph(method, options["maps"])
    return lambda motion: graph.map_along(motion, speech, target, intensity=amount)


def _graph(method: Method, maps: Path | None) -> AnimeGraph:
    from facesynth.methods.anime_graph.method import AnimeGraph
    from facesynth.methods.registry import load

    graph = load(maps) if maps else method
    if not isinstance(graph, AnimeGraph):
        raise FacesynthError(f"{graph.name} learns no emotion maps; give an anime graph of the same performer with --maps")
    return graph


def account(method: Method, speech: Speech, settings: dict[str, Any]) -> dict[str, Any]:
    """What the search found, for JSON: eFASE's shares of wrong nodes; what an anime graph lacked or lost is also said."""
    from facesynth.methods.anime_graph.method import AnimeGraph
    from facesynth.methods.efase.method import Efase

    if isinstance(method, Efase):
        return {"search": method.report(speech, **settings)}
    if not isinstance(method, AnimeGraph):
        return {}
    found = method.plan(speech, **settings).summary()
    for what in ("phone_fallbacks", "emotion_fallbacks"):
        for level, count in found[what].items():
            click.echo(f"warning: {count} of {found['phones']} phones are not in the graph as asked for: {level}", err=True)
    if "look_ahead" in settings:
        click.echo(f"look-ahead of {settings['look_ahead']} phones: {found['extra_cost']:.2%} over the least cost", err=True)
    return {"search": found}
