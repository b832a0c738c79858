"""Bring a facesynth animation into Blender, with its sound, and render it if asked.

Runs inside Blender 4.2 or newer, or in Python with the `bpy` wheel; it needs nothing of facesynth.

    blender --background --python blender_import.py -- speech.glb --sound speech.wav --save speech.blend
    blender my_head.blend --background --python blender_import.py -- speech.csv --mesh Head --render speech.mp4

A `.glb` brings its own head. A `.csv` (Live Link Face) moves the shape keys of a mesh of yours that have ARKit's
names, and turns an object of yours with the head. See blender.md.
"""

import argparse
import csv
import json
import math
import struct
import sys
from pathlib import Path

import bpy
from mathutils import Euler, Quaternion

AXES = "Blender has z up and a face looking to -y; glTF and facesynth have y up and a face looking to +z."


def main() -> None:
    """Import, set the frame rate and the range, add the sound, save, render."""
    options = parse(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
    source = options.animation
    if source.suffix.lower() == ".glb":
        bpy.ops.wm.read_factory_settings(use_empty=True)
        seconds = import_glb(source, options.fps or glb_fps(source))
        light_and_camera()
    else:
        header, rows, fps = read_livelink(source, options.fps)
        set_fps(fps)
        moved = apply_shapes(find_mesh(options.mesh), header, rows)
        print(f"{moved} of 52 shapes found on the mesh")
        if options.head:
            turn_head(bpy.data.objects[options.head], header, rows)
        seconds = len(rows) / fps
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, max(1, round(seconds * scene.render.fps / scene.render.fps_base))
    if options.sound:
        add_sound(options.sound)
    if options.save:
        bpy.ops.wm.save_as_mainfile(filepath=str(options.save.resolve()))
    if options.render:
        render(options)


def parse(arguments: list[str]) -> argparse.Namespace:
    """Read the command line after `--`."""
    parser = argparse.ArgumentParser(prog="blender_import.py", description=__doc__.splitlines()[0])
    parser.add_argument("animation", type=Path, help=".glb or Live Link Face .csv")
    parser.add_argument("--fps", type=float, help="frame rate of the scene; by default the file's")
    parser.add_argument("--mesh", help="object whose shape keys a .csv moves; by default the one with most ARKit names")
    parser.add_argument("--head", help="object that a .csv turns with the head")
    parser.add_argument("--sound", type=Path, help="sound file to lie under the animation")
    parser.add_argument("--save", type=Path, help=".blend to write")
    parser.add_argument("--render", type=Path, help=".mp4 to render, or a folder for pictures")
    parser.add_argument("--size", default="1280x720", help="of the rendering")
    parser.add_argument("--samples", type=int, default=16, help="of Cycles, per pixel")
    parser.add_argument("--last", type=int, help="render up to this frame only")
    return parser.parse_args(arguments)


def set_fps(fps: float) -> None:
    """23.976 becomes 24 / 1.001, as Blender wants it."""
    render_settings = bpy.context.scene.render
    render_settings.fps = math.ceil(fps - 1e-6)
    render_settings.fps_base = render_settings.fps / fps


def glb_fps(path: Path) -> float:
    """The rate that facesynth notes beside the animation; 30 where there is none."""
    with path.open("rb") as file:
        length = struct.unpack("<3I2I", file.read(20))[3]
        document = json.loads(file.read(length))
    return float(document.get("animations", [{}])[0].get("extras", {}).get("fps", 30.0))


def import_glb(path: Path, fps: float) -> float:
    """Import the head; frame 1 is the start of the sound. Returns the length in seconds."""
    counted = math.ceil(fps - 1e-6)
    set_fps(counted)  # the importer turns seconds into frames and knows whole rates only
    bpy.ops.import_scene.gltf(filepath=str(path.resolve()))
    for thing in [thing for thing in bpy.data.objects if thing.name.startswith("Icosphere")]:
        bpy.data.objects.remove(thing)  # the importer's own shape for bones
    last = 0.0
    for curve in [curve for action in bpy.data.actions for curve in curves_of(action)]:
        for key in curve.keyframe_points:
            for point in (key.co, key.handle_left, key.handle_right):
                point.x = 1 + point.x * fps / counted
        last = max(last, curve.keyframe_points[-1].co.x)
    set_fps(fps)
    return last / fps


def curves_of(action: "bpy.types.Action") -> list:
    """All curves of an action, in Blender 4 and in the layered actions of Blender 5."""
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    return [c for layer in action.layers for strip in layer.strips for bag in strip.channelbags for c in bag.fcurves]


def read_livelink(path: Path, fps: float | None) -> tuple[list[str], list[list[float]], float]:
    """(column names, rows of numbers, frame rate); the rate is read off the timecodes of takes over a second long."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        header, *rows = [row for row in csv.reader(file) if row]
    if not fps:
        parts = [[float(part) for part in row[0].split(":")] for row in rows]
        rate = int(max(part[3] for part in parts)) + 1
        clock = [(h * 3600 + m * 60 + s) * rate + f for h, m, s, f in parts]
        if parts[0][2] == parts[-1][2]:
            sys.exit("the take is too short to show its frame rate: give --fps")
        fps = rate * (len(clock) - 1) / (clock[-1] - clock[0])
    return header[2:], [[float(value) for value in row[2:]] for row in rows], fps


def find_mesh(name: str | None) -> "bpy.types.Object":
    """The named object, or the one with most shape keys of ARKit's names."""
    if name:
        return bpy.data.objects[name]
    keyed = [thing for thing in bpy.data.objects if thing.type == "MESH" and thing.data.shape_keys]
    if not keyed:
        sys.exit("no mesh with shape keys in this file: open your head first, or import the .glb instead")
    return max(keyed, key=lambda thing: sum(plain(key.name) == "jawopen" for key in thing.data.shape_keys.key_blocks))


def plain(name: str) -> str:
    """jawOpen, JawOpen, jaw_open and Jaw.Open are one shape; so are eyeBlink_L and eyeBlinkLeft."""
    if name[-2:-1] in {"_", "."} and name[-1] in {"L", "R"}:
        name = name[:-2] + ("Left" if name[-1] == "L" else "Right")
    return "".join(letter for letter in name.lower() if letter.isalnum())


def apply_shapes(mesh: "bpy.types.Object", header: list[str], rows: list[list[float]]) -> int:
    """Key the shapes frame by frame; returns how many of the columns were found."""
    keys = {plain(key.name): key for key in mesh.data.shape_keys.key_blocks}
    found = 0
    for column, name in enumerate(header[:52]):
        key = keys.get(plain(name))
        if key is None:
            continue
        found += 1
        for frame, row in enumerate(rows, start=1):
            key.value = row[column]
            key.keyframe_insert("value", frame=frame)
    return found


def turn_head(thing: "bpy.types.Object", header: list[str], rows: list[list[float]]) -> None:
    """Turn an object by HeadYaw (to the performer's right), HeadPitch (down) and HeadRoll (to their left shoulder)."""
    columns = [header.index(name) for name in ("HeadYaw", "HeadPitch", "HeadRoll")]
    thing.rotation_mode = "QUATERNION"
    start, before = thing.rotation_quaternion.copy(), None
    for frame, row in enumerate(rows, start=1):
        yaw, pitch, roll = (row[column] for column in columns)
        turn = Euler((0, -yaw, 0)).to_quaternion() @ Euler((pitch, 0, 0)).to_quaternion() @ Euler((0, 0, -roll)).to_quaternion()
        turned = Quaternion((turn.w, turn.x, -turn.z, turn.y)) @ start  # see AXES
        if before is not None and before.dot(turned) < 0:
            turned.negate()
        thing.rotation_quaternion = before = turned
        thing.keyframe_insert("rotation_quaternion", frame=frame)


def add_sound(path: Path) -> None:
    """Lay the sound under the animation, from frame 1."""
    editor = bpy.context.scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strips.new_sound("speech", str(path.resolve()), channel=1, frame_start=1)
    bpy.context.scene.sync_mode = "AUDIO_SYNC"


def light_and_camera() -> None:
    """A key light, a fill and a portrait camera before the head, which is 25 cm tall and looks to -y."""
    for name, place, watts, size in (("key", (-0.6, -0.9, 0.5), 14.0, 0.4), ("fill", (0.8, -0.8, 0.0), 4.0, 0.8)):
        lamp = bpy.data.lights.new(name, "AREA")
        lamp.energy, lamp.size = watts, size
        holder = bpy.data.objects.new(name, lamp)
        holder.location = place
        holder.rotation_euler = (-holder.location).to_track_quat("-Z", "Y").to_euler()
        bpy.context.scene.collection.objects.link(holder)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.lens, camera.location, camera.rotation_euler = 85.0, (0.0, -1.2, -0.03), (math.pi / 2, 0, 0)
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    world = bpy.data.worlds.new("grey")
    world.color = (0.03, 0.03, 0.035)
    bpy.context.scene.world = world


def render(options: argparse.Namespace) -> None:
    """Render with Cycles, which needs no graphics card; EEVEE is faster where there is one."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = options.samples, False
    scene.render.resolution_x, scene.render.resolution_y = map(int, options.size.split("x"))
    scene.render.filepath = str(options.render.resolve())
    scene.frame_end = min(scene.frame_end, options.last or scene.frame_end)
    if options.render.suffix.lower() == ".mp4":
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):  # Blender 5
            settings.media_type = "VIDEO"
        settings.file_format = "FFMPEG"
        scene.render.ffmpeg.format, scene.render.ffmpeg.codec = "MPEG4", "H264"
        scene.render.ffmpeg.audio_codec = "AAC"
    else:
        scene.render.filepath += "/"
    bpy.ops.render.render(animation=True)


if __name__ == "__main__":
    main()
