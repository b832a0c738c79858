"""`facesynth export`."""

import json
import sys
from pathlib import Path
from typing import Any

import click

from facesynth.cli.types import FILE


@click.command("export")
@click.argument("model", type=FILE)
@click.option("-o", "--output", required=True, type=FILE, help="Folder to write.")
@click.option(
    "--weights",
    type=click.Choice(["float32", "float16", "int8"]),
    default="float32",
    show_default=True,
    help="In what large constants are kept; fewer bits are smaller and less exact.",
)
@click.option(
    "--beside",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="File of a model of phones alone: what it says is averaged with what MODEL, a network that hears, says.",
)
@click.option("--share", type=float, default=0.5, show_default=True, help="How much of the mean --beside counts, 0 to 1.")
@click.option("--json", "as_json", is_flag=True, help="Print the manifest.")
@click.pass_obj
def export(
    only: str | None, /, model: Path, output: Path, weights: str, beside: Path | None, share: float, as_json: bool
) -> None:
    """Write MODEL as a folder that runs without torch: ONNX graphs, arrays and a manifest.

    The words `features`, `phones` and `face` in place of a model's file write what is heard in sound, the network that hears
    phones, and what moves the head. The name of a model that comes with facesynth copies its folder, which is one already.

    Every graph is compared with facesynth at two batch sizes and two lengths. facesynth-runtime runs the folder.
    """
    from facesynth.export.models import export_model
    from facesynth.export.parts import export_face, export_features
    from facesynth.export.phones import export_phones
    from facesynth.zoo.copying import copy_packaged, is_packaged

    kept: Any = weights
    parts = {"features": export_features, "phones": export_phones, "face": export_face}
    if only in (None, str(model)) and str(model) in parts:
        manifest = parts[str(model)](output, kept)
    elif only is None and is_packaged(model):
        manifest = copy_packaged(model, output, changed=weights != "float32" or beside is not None)
    else:
        manifest = export_model(model, output, kept, only=only, beside=None if beside is None else (beside, share))
    if "unknown" in (*manifest["training_data"]["licences"], *manifest["training_data"]["consents"]):
        click.echo(f"warning: {model} does not state under which licences and consents it was trained", err=True)
    if as_json:
        click.echo(json.dumps(manifest))
        return
    for name, entry in manifest["graphs"].items():
        difference = entry["parity"]["largest_relative_difference"]
        click.echo(f"{name}: differs from facesynth by at most {difference:.2g} of the largest value", err=True)
    total = sum(file["bytes"] for file in manifest["files"].values())
    click.echo(f"{output}: {manifest['method']}, {total / 1e6:.2f} MB in {len(manifest['files'])} files", err=True)


def export_only(method: str) -> None:
    """What the scripts under export/ run: the same for models of one method."""
    from facesynth.cli import run

    run(export, [*([method] if method in ("features", "phones", "face") else []), *sys.argv[1:]], method)
