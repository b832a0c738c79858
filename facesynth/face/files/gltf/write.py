"""A head with its shapes and an animation in one binary glTF file."""

from pathlib import Path

import pygltflib as gl

from facesynth.atomic import atomic_path
from facesynth.face.animation import FaceAnimation
from facesynth.face.files.gltf.built_in import built_in_document
from facesynth.face.files.gltf.own import animated_document, obj_document
from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.rig.own_head import OwnHead


def write_glb(path: str | Path, animation: FaceAnimation, head: Rig | OwnHead) -> None:
    """Write the built-in head, or one's own: its own file with one more animation, or a new file where it came as OBJ."""
    if not isinstance(head, OwnHead):
        document, buffer = built_in_document(animation, head)
    elif head.source.is_file():
        document, buffer = animated_document(animation, head)
    else:
        document, buffer = obj_document(animation, head)
    document.accessors, document.bufferViews = buffer.accessors, buffer.views
    document.buffers = [gl.Buffer(byteLength=len(buffer.data))]
    document.set_binary_blob(bytes(buffer.data))
    with atomic_path(path) as part:
        part.write_bytes(b"".join(document.save_to_bytes()))
