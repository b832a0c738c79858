"""`facesynth corpus edit`: nodes that a corpus's models may use. Recordings are never touched; edits.jsonl only grows."""

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.options import as_json, show
from facesynth.cli.types import FILE, FOLDER
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.corpus.journal import Edit


@click.group("edit")
def edit() -> None:
    """Remove contaminated nodes, restore them, draw new ones; every edit can be undone.

    A node is one phone of one utterance, utterance:number, counted from 0 with silences; drawn ones are +:number. Training
    leaves removed nodes out and learns from drawn ones; `speak --edits FOLDER/edits.jsonl` does so with a model that is
    trained already.
    """


@edit.command("list")
@click.argument("folder", type=FOLDER)
@as_json
def list_edits(folder: Path, as_json: bool) -> None:
    """List what is removed and what was drawn, and every edit that led there."""
    from facesynth.corpus import Corpus

    journal = Corpus.open(folder).journal
    edits, force, sum_ = journal.edits, {one.number for one in journal.in_force}, journal.sum()
    facts = {
        "removed": sorted(sum_.removed),
        "drawn": [_of_node(node) for node in sum_.added],
        "edits": [{"number": one.number, "in_force": one.number in force, **_plain(one)} for one in edits],
    }
    lines = [f"{one.number:4d}  {_said(one)}{'' if one.number in force or one.op == 'undo' else ' (undone)'}" for one in edits]
    lines.append(f"{len(sum_.removed)} nodes are removed, {len(sum_.added)} drawn ones are in use")
    show(as_json, facts, lines)


@edit.command("remove")
@click.argument("folder", type=FOLDER)
@click.argument("nodes", nargs=-1, required=True)
@as_json
def remove(folder: Path, nodes: tuple[str, ...], as_json: bool) -> None:
    """Remove NODES, such as s01_happy:4; all of them or, where one is none of the corpus or removed already, none."""
    from facesynth.corpus import Corpus

    corpus = Corpus.open(folder)
    names = _checked(corpus, nodes, removed=False)
    for name in names:
        corpus.remove_node(name)
    show(as_json, {"removed": names}, [f"removed {', '.join(names)}"])


@edit.command("restore")
@click.argument("folder", type=FOLDER)
@click.argument("nodes", nargs=-1, required=True)
@as_json
def restore(folder: Path, nodes: tuple[str, ...], as_json: bool) -> None:
    """Let NODES that were removed be used again; all of them or none."""
    from facesynth.corpus import Corpus

    corpus = Corpus.open(folder)
    names = _checked(corpus, nodes, removed=True)
    for name in names:
        corpus.restore_node(name)
    show(as_json, {"restored": names}, [f"restored {', '.join(names)}"])


@edit.command("add")
@click.argument("folder", type=FOLDER)
@click.option("--phone", required=True, help="What it says.")
@click.option("--emotion", required=True, help="In which emotion of the corpus.")
@click.option("--title", default="", help="A name for people; the node itself is called +:number.")
@click.option("--motion", type=FILE, help="NPZ or CSV with its motion, as `corpus add` takes it beside a sound.")
@click.option("--model", type=FILE, help="A model of the corpus, on whose map of the phone the node is drawn.")
@click.option("--path", type=FILE, help="With --model: CSV of places x,y on that map, in order.")
@click.option("--seconds", type=click.FloatRange(min=0, min_open=True), help="With --model: how long the node lasts.")
@click.option("--map", "kind", type=click.Choice(["isomap", "pca"]), default="isomap", show_default=True, help="Which map.")
@as_json
def add(
    *,
    folder: Path,
    phone: str,
    emotion: str,
    title: str,
    motion: Path | None,
    model: Path | None,
    path: Path | None,
    seconds: float | None,
    kind: Any,
    as_json: bool,
) -> None:
    """Add a node that nobody recorded: motion from a file, or drawn as a path on a phone's map."""
    from facesynth.corpus import Corpus
    from facesynth.methods.drawing import add_motion, drawn_motion, motion_from_file, read_path
    from facesynth.methods.registry import load

    corpus = Corpus.open(folder)
    if motion is not None and model is None and path is None and seconds is None:
        new = motion_from_file(corpus, motion)
    elif motion is None and model is not None and path is not None and seconds is not None:
        new = drawn_motion(corpus, load(model), phone, read_path(path), seconds, kind)
    else:
        raise FacesynthError("give --motion FILE, or --model, --path and --seconds together")
    node = add_motion(corpus, phone, emotion, new, title)
    show(as_json, {**_of_node(node), "remarks": list(new.remarks)}, [*new.remarks, f"added {node.name} ({phone}, {emotion})"])


@edit.command("undo")
@click.argument("folder", type=FOLDER)
@as_json
def undo(folder: Path, as_json: bool) -> None:
    """Take back the newest edit that is in force."""
    from facesynth.corpus import Corpus

    taken = Corpus.open(folder).undo()
    show(as_json, {"undone": {"number": taken.number, **_plain(taken)}}, [f"undone: {_said(taken)}"])


@edit.command("suspects")
@click.argument("folder", type=FOLDER)
@click.option("--model", type=FILE, help="A model of the corpus: nodes far from all others of their phone are listed, too.")
@click.option("--most", type=click.IntRange(min=1), default=40, show_default=True, help="How many to list.")
@as_json
def list_suspects(folder: Path, model: Path | None, most: int, as_json: bool) -> None:
    """List nodes that had better be looked at, the worst first."""
    from facesynth.corpus import Corpus
    from facesynth.methods.capabilities import Browsing
    from facesynth.methods.registry import load, require
    from facesynth.methods.suspects import suspects

    found = suspects(Corpus.open(folder), require(load(model), Browsing) if model else None)
    lines = [f"{one.node} ({one.phone}, {one.emotion}), {one.score:.1f}: {'; '.join(one.reasons)}" for one in found[:most]]
    lines.append(f"{len(found)} nodes are suspicious" if found else "no node is suspicious")
    show(as_json, {"suspects": [asdict(one) for one in found[:most]], "count": len(found)}, lines)


def _checked(corpus: Any, nodes: Iterable[str], *, removed: bool) -> list[str]:
    """The names as they are written, without repetition; FacesynthError where one of them would stay as it is."""
    names = list(dict.fromkeys(corpus.known_node(name) for name in nodes))
    gone = corpus.removed_nodes()
    for name in names:
        if (name in gone) != removed:
            raise FacesynthError(f"{name} is {'not removed' if removed else 'removed already'}; nothing was changed")
    return names


def _of_node(node: Any) -> dict[str, Any]:
    return {"node": node.name, "phone": node.phone, "emotion": node.emotion, "frames": len(node.frames), "title": node.title}


def _plain(one: "Edit") -> dict[str, Any]:
    """An edit without its frames."""
    return {"op": one.op, **{name: len(value) if name == "frames" else value for name, value in one.facts.items()}}


def _said(one: "Edit") -> str:
    facts = one.facts
    if one.op == "add":
        title = f" {facts['title']!r}" if facts.get("title") else ""
        return f"add +:{one.number}{title} ({facts['phone']}, {facts['emotion']}, {len(facts['frames'])} frames)"
    return f"undo {facts['of']}" if one.op == "undo" else f"{one.op} {facts['node']}"
