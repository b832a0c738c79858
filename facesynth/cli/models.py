"""`facesynth models`, `card`, `push` and `pull`: models that can be used at once, and how they are carried elsewhere."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.options import as_json, show
from facesynth.cli.types import FILE
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.zoo.shelf import Entry


@click.command("models")
@click.argument("name", required=False)
@as_json
def models(name: str | None, as_json: bool) -> None:
    """List the models that can be used at once; with NAME, show the card of one."""
    from facesynth.zoo.shelf import DEFAULT, entry, names

    entries = [entry(one) for one in ([name] if name else names())]
    show(as_json, [_facts(one) for one in entries], [_shown(entries[0])] if name else [_listed(one, DEFAULT) for one in entries])


def _listed(one: Entry, default: str) -> str:
    head = f"{one.name}{' (default)' if one.name == default else ''}"
    return f"{head:24} {one.part:10} {one.method:16} {one.layout:16} {one.size_bytes / 1e6:5.1f} MB  {one.card.title}"


def _facts(one: Entry) -> dict[str, Any]:
    kept = {name: getattr(one, name) for name in ("name", "method", "part", "layout", "size_bytes")}
    return kept | {"path": str(one.path), "card": asdict(one.card)}


def _shown(one: Entry) -> str:
    card = one.card
    lines = [
        f"{one.name}: {card.title}",
        f"method       {one.method}, moves the {one.part}; {one.layout}; {one.size_bytes / 1e6:.1f} MB in {one.path}",
        f"performer    {card.performer}; languages: {', '.join(card.languages)}",
        f"licence      {card.licence}",
        f"consent      {card.consent}",
        *(f"measured     {figure.value:g}: {figure.what} ({figure.command})" for figure in card.figures),
        *(f"limit        {limit}" for limit in card.limits),
    ]
    return "\n".join([*lines, f"rebuild      {card.rebuild}"] if card.rebuild else lines)


@click.command("card")
@click.argument("model", type=FILE)
@as_json
def card(model: Path, as_json: bool) -> None:
    """Write the card of MODEL, a file or an exported folder: performer, licence and consent as it states them.

    It lies in the folder, or beside the file as NAME.card.yaml. What it does not know is said to be unknown; complete it by
    hand. A card that is there stays, and is checked.
    """
    from facesynth.inference.folder import CARD
    from facesynth.methods.registry import load_trained
    from facesynth.zoo.card import draft, read_card, write_card
    from facesynth.zoo.shelf import find

    path = find(model)
    target = path / CARD if path.is_dir() else path.with_name(f"{path.stem}.{CARD}")
    if not target.exists():
        trained: Any = load_trained(path)
        performer = trained.provenance.get("performer", "an unknown performer")
        write_card(target, draft(f"{trained.name} of {performer}", trained.provenance))
    found = read_card(target)
    show(as_json, {"card": str(target), **asdict(found)}, [f"{target}: {found.title}; licence: {found.licence}"])


@click.command("push")
@click.argument("model", type=FILE)
@click.argument("folder", type=FILE)
@as_json
def push(model: Path, folder: Path, as_json: bool) -> None:
    """Write MODEL, an exported folder with a card, into one file in FOLDER, which `pull` takes from there or from a URL."""
    from facesynth.methods.trained import is_exported
    from facesynth.zoo.parcel import push as write_parcel
    from facesynth.zoo.shelf import find

    if not is_exported(source := find(model)):
        raise FacesynthError(
            f"{source} is no exported folder; run `facesynth export {source} -o NAME/` and `facesynth card NAME/`"
        )
    path, sha256 = write_parcel(source, folder)
    facts = {"file": str(path), "sha256": sha256, "bytes": path.stat().st_size}
    show(as_json, facts, [f"{path}: {path.stat().st_size / 1e6:.2f} MB, sha256 {sha256}"])


@click.command("pull")
@click.argument("source")
@click.option("--sha256", help="That the file must have, as `push` printed it.")
@as_json
def pull(source: str, sha256: str | None, as_json: bool) -> None:
    """Keep the model in SOURCE, a file or URL that you trust to be reached, so that `speak` knows it by its name.

    Nothing in it is run; its files are compared with their hashes, and it must have a card with a licence.
    """
    from facesynth.zoo.parcel import pull as take

    one = take(source, sha256=sha256)
    show(as_json, _facts(one), [f"{one.name}: {one.card.title}; licence: {one.card.licence}"])
