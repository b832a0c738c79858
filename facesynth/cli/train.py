"""`facesynth train`."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.options import as_json, seeded, show, spread_over
from facesynth.cli.types import FILE
from facesynth.inference.errors import FacesynthError, unknown

if TYPE_CHECKING:
    import torch

    from facesynth.corpus import Corpus
    from facesynth.corpus.workers import Workers
    from facesynth.methods.method import Method


@click.command("train")
@click.argument("method", required=False)
@click.argument("corpus", type=FILE, required=False)
@click.argument("settings", nargs=-1, metavar="[KEY=VALUE]...")
@click.option("-o", "--output", type=FILE, help="Model file; METHOD.safetensors in this folder otherwise.")
@click.option("--config", type=FILE, help="YAML file of settings; KEY=VALUE goes before it.")
@click.option("--split", type=click.Choice(["all", "train"]), default="all", show_default=True, help="Sentences to learn from.")
@click.option("--emotion", "only", help="Learn from recordings of this emotion alone; all otherwise.")
@click.option("--device", help="auto (the default), cpu, cuda or mps; `device` of --config otherwise.")
@seeded
@spread_over("--jobs", 1, "Independent pieces of learning at once; 1 otherwise.")
@as_json
def train(
    *,
    method: str | None,
    corpus: Path | None,
    settings: tuple[str, ...],
    output: Path | None,
    config: Path | None,
    split: str,
    only: str | None,
    device: str | None,
    seed: int,
    as_json: bool,
    workers: Workers,
) -> None:
    """Train METHOD on CORPUS and write one model file; without METHOD, what is nearest to recordings, as it is nearest.

    METHOD `emotion` makes a detector of emotions in the voice; it also learns from a CSV of sound files
    (file,emotion,speaker,sentence). By --jobs or --engine are spread what is heard in each recording, the searches that
    weights are learned from, the folds that numbers of states are chosen by, and emotion maps; networks learn in one process.
    The model is the same, to the byte.

    A method that takes key shapes by hand makes a model of a CSV (phones, a column for each channel of the rig) in place
    of CORPUS, or of one that comes with facesynth, by its name (`arkit`): nothing is recorded for it.
    """
    from facesynth.config import load_config, parse_settings
    from facesynth.corpus.workers import ALONE
    from facesynth.device import device_of
    from facesynth.methods.learn.spreading import working
    from facesynth.methods.registry import method_class, of_table
    from facesynth.methods.training import train as learn
    from facesynth.stage.speaker_pictures import save_face

    method, corpus, settings, known = _asked(method, corpus, settings)
    chosen = {**(load_config(config) if config else known), **parse_settings(settings)}
    place = device_of(device or str(chosen.pop("device", "auto")))
    path = output or Path(f"{method}.safetensors")
    if method == "emotion":
        if only is not None:
            raise FacesynthError("a detector of emotions learns from all of them; leave out --emotion")
        from facesynth.cli.emotion import train_detector

        train_detector(corpus, chosen, path, seed if split == "train" else None, workers=workers, as_json=as_json)
        return
    if (made := of_table(method, str(corpus), chosen)) is not None:
        made.save(path)
        _tell_made(path, method, len(made.fitted_layout.names), as_json=as_json)
        return
    method_class(method).from_config(chosen)  # a wrong setting is told before a corpus is read
    recordings = _recordings(corpus, seed if split == "train" else None, only)
    start = time.perf_counter()
    with working(workers) as team:
        model = learn(method_class(method), recordings, chosen, seed=seed, device=_for_workers(place, workers))
    seconds = time.perf_counter() - start
    model.save(path)
    if workers != ALONE and not team.pieces:
        click.echo(f"warning: {method} learned in one process: nothing of it consists of independent pieces", err=True)
    _tell_learned(model, recordings, path, save_face(recordings, path), seconds, as_json=as_json)


def _recordings(corpus: Path, seed: int | None, only: str | None) -> Corpus:
    """What is learned from: all recordings, or those of one emotion; with a seed those of the sentences to train on."""
    from facesynth.corpus import Corpus

    recordings = Corpus.open(corpus)
    _require_speech(recordings)
    if only is not None:
        recordings = _felt(recordings, only)
    return recordings if seed is None else recordings.split(seed)[0]


def _felt(recordings: Corpus, emotion: str) -> Corpus:
    """Those that were recorded in one emotion."""
    ids = [name for name in recordings.ids if recordings.record(name).emotion == emotion]
    if not ids:
        there = sorted({recordings.record(name).emotion for name in recordings.ids})
        raise unknown("emotion of a recording", emotion, there)
    return recordings.subset(ids)


def _tell_learned(model: Method, recordings: Corpus, path: Path, face: Path | None, seconds: float, *, as_json: bool) -> None:
    """What was learned from whom, and where it is."""
    size_mb = path.stat().st_size / 1e6
    facts = {"model": str(path), "method": model.name, "utterances": len(recordings), "train_s": seconds, "model_mb": size_mb}
    facts |= _left_out(model.facts)
    kind = "synthetic performer" if recordings.synthetic else "performer"
    lines = [f"{model.name} learned from {len(recordings)} utterances of the {kind} {recordings.performer} in {seconds:.1f} s"]
    if moved := model.facts.get("repaired"):
        moduli = ", ".join(f"{modulus:.3f}" for modulus in moved)
        lines.append(f"unstable: eigenvalues of modulus {moduli} were moved inside, the rest refitted")
    lines += model.facts.get("findings", ())
    if face:
        lines.append(f"{face}: {face.stat().st_size / 1e6:.1f} MB, the speaker's pictures; keep it beside the model")
    words = '--text "…" ' if model.needs_phones else ""
    lines.append(f"{path}: {size_mb:.1f} MB; speak with `facesynth speak {path} speech.wav {words}-o out.mp4`")
    show(as_json, {**facts, "synthetic": recordings.synthetic}, lines)


def _asked(
    method: str | None, corpus: Path | None, settings: tuple[str, ...]
) -> tuple[str, Path, tuple[str, ...], Mapping[str, Any]]:
    """Method, corpus, settings, and those that stand in where no file of them is given: of `train CORPUS [KEY=VALUE]...` too."""
    from facesynth.methods.registry import DEFAULT, capabilities_of, list_methods

    if method is None:
        raise click.UsageError("name a corpus, or a method and a corpus")
    alone = corpus is None or "=" in str(corpus)
    if not alone and corpus is not None:
        return method, corpus, settings, {}
    if method in list_methods() or not Path(method).is_dir():
        raise click.UsageError(f"{method} is no folder of a corpus; wanted `train CORPUS`, or `train {method} CORPUS`")
    return DEFAULT, Path(method), (*([str(corpus)] if corpus else []), *settings), capabilities_of(DEFAULT).nearest


def _tell_made(path: Path, method: str, channels: int, *, as_json: bool) -> None:
    made = f"{path}: {method} of shapes by hand, {channels} channels; nothing was learned from anybody's recordings of them"
    lines = [made, f'speak with `facesynth speak {path} speech.wav --text "…" -o out.mp4`']
    show(as_json, {"model": str(path), "method": method, "channels": channels}, lines)


def _left_out(found: Mapping[str, Any]) -> dict[str, Any]:
    """What of the recordings a method could not use, with a warning for a person."""
    facts: dict[str, Any] = {}
    if (unusable := found.get("unusable_phones", 0)) > 0:
        facts["unusable_phones"] = unusable
        click.echo(f"warning: {unusable} recorded phones were left out: their motion has gaps, or they were removed", err=True)
    for reason in found.get("emotions_left_out", {}).values():
        click.echo(f"warning: {reason}", err=True)
    if barren := found.get("barren"):
        facts["utterances_left_out"] = barren
        click.echo(f"warning: nothing of {', '.join(barren)} could be used; `facesynth corpus check` says why", err=True)
    return facts


def _for_workers(place: torch.device, workers: Workers) -> torch.device:
    """The device, which several processes cannot share."""
    from facesynth.corpus.workers import ALONE

    if workers != ALONE and place.type != "cpu":
        raise FacesynthError(f"--jobs and --engine spread what the processor does; got the device {place}: give --device cpu")
    return place


def _require_speech(recordings: Corpus) -> None:
    """FacesynthError, with the reasons, where no recording is usable."""
    if not len(recordings) and recordings.records:
        reasons = list(dict.fromkeys(record.reason or "marked unusable" for record in recordings.records))
        raise FacesynthError(
            f"none of the {len(recordings.records)} recordings of {recordings.path} teaches speech ({'; '.join(reasons[:3])});"
            " `facesynth corpus stats` says what they hold"
        )
