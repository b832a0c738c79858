"""`facesynth retarget`: a performer's motion on a head whose shapes nobody has described, from a few frames posed by hand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from facesynth.cli.options import as_json, show
from facesynth.cli.targets import plan_targets
from facesynth.cli.types import FILE
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.corpus import Corpus


@click.command("retarget")
@click.argument("corpus", type=FILE)
@click.argument("poses", type=FILE)
@click.argument("motions", nargs=-1)
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    type=FILE,
    help="File to write: .csv .npz .bvh, with --rig also .glb; {name} stands for the name of the motion.",
)
@click.option("--rig", type=FILE, help="The head: .glb, .gltf, or a folder of OBJ files.")
@click.option("--suggest", type=click.IntRange(min=2), help="Write POSES: so many frames worth posing, weights to be filled in.")
@click.option("--export", "exported", type=FILE, help="Folder for what was learned, as an ONNX graph.")
@as_json
def retarget(
    *,
    corpus: Path,
    poses: Path,
    motions: tuple[str, ...],
    outputs: tuple[Path, ...],
    rig: Path | None,
    suggest: int | None,
    exported: Path | None,
    as_json: bool,
) -> None:
    """Put MOTIONS of the performer of CORPUS on a head, by the key poses in POSES.

    POSES is a CSV: utterance, time_s (or frame), and a column for each channel of the head, with its weights in that frame;
    ten to twenty frames are good. MOTIONS are utterances of the corpus, .npz files that `speak` wrote, or motion files.
    """
    from facesynth.corpus import Corpus
    from facesynth.face.rig.own_head import load_own_head

    recordings = Corpus.open(corpus)
    head = None if rig is None else load_own_head(rig, needs_arkit=False)
    channels = () if head is None else head.names
    if suggest is not None:
        _suggest(recordings, poses, suggest, channels)
        return
    if bool(motions) != bool(outputs) or not (outputs or exported):
        raise click.UsageError("name motions and -o, --export, or --suggest")
    from facesynth.face.files.formats import require_suffix, write_animation
    from facesynth.face.rig.arkit_rig import load_head
    from facesynth.stage.key_poses import learned, motion_of, read_key_poses

    for output in outputs:
        require_suffix(output)
    plan = plan_targets([Path(name) for name in motions], outputs, [], [poses, *([rig] if rig else [])])
    given = read_key_poses(poses, recordings, channels)
    found, written = learned(given, recordings), []
    shown = head or load_head()
    for path, targets in plan.items():
        animation = found.animation(motion_of(str(path), recordings))
        for target in targets:
            write_animation(target, animation, shown)
            click.echo(f"{target}: {animation.duration_s:.2f} s, {len(animation.names)} channels", err=True)
            written.append(str(target))
    if exported is not None:
        from facesynth.export.key_poses import export_key_poses

        export_key_poses(exported, found, recordings.provenance())
        written.append(str(exported))
    show(as_json, {"key_poses": len(given.frames), "written": written}, [])


def _suggest(corpus: Corpus, poses: Path, count: int, channels: tuple[str, ...]) -> None:
    from facesynth.atomic import write_text
    from facesynth.stage.key_poses import suggested, table_to_fill

    if poses.exists():
        raise FacesynthError(f"{poses} exists; its weights would be lost: name another file")
    write_text(poses, table_to_fill(suggested(corpus, count), channels))
    click.echo(f"{poses}: {count} frames to pose; fill in the weights of the head for each", err=True)
