"""Small heads as strangers make them: own names, own units, nodes that turn and scale."""

import numpy as np
import pygltflib as gl

from facesynth.face.files.gltf.buffer import Buffer

SIDE = 13
SHAPES = ("Mouth_Open", "Smile_L", "Smile_R", "Blink", "Frozen")


def mask():
    """[V, 3] cm: a bulging mask of 14 by 20 cm, and [F, 3] its triangles; [5, V, 3] its shapes."""
    x, y = np.meshgrid(np.linspace(-7, 7, SIDE), np.linspace(-10, 10, SIDE))
    vertices = np.stack([x, y, 5 * (1 - (x / 7) ** 2) * (1 - (y / 10) ** 2)], axis=-1).reshape(-1, 3)
    corner = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel(), corner[1:, 1:].ravel(), corner[1:, :-1].ravel()
    shapes = np.zeros((5, len(vertices), 3))
    shapes[0, vertices[:, 1] < -3, 1] = -2.0
    shapes[1, (vertices[:, 0] > 2) & (vertices[:, 1] < 0), 1] = 1.0
    shapes[2, (vertices[:, 0] < -2) & (vertices[:, 1] < 0), 1] = 1.0
    shapes[3, vertices[:, 1] > 6, 2] = 0.5
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), shapes


def write_mask(path, names=SHAPES, node=None, eyes=True):
    """The mask as .glb, in a unit of its own, under nodes that scale and turn."""
    vertices, triangles, shapes = mask()
    buffer = Buffer()
    position = buffer.add(vertices.astype(np.float32), gl.ARRAY_BUFFER)
    indices = buffer.add(triangles.astype(np.uint16).ravel(), gl.ELEMENT_ARRAY_BUFFER)
    targets = [{"POSITION": buffer.add(shape.astype(np.float32), gl.ARRAY_BUFFER)} for shape in shapes[: len(names)]]
    face = gl.Primitive(attributes=gl.Attributes(POSITION=position), indices=indices, targets=targets, material=0)
    ball = vertices[:4] * 0 + [[0.5, 0, 0], [-0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0.5]]
    ball_at = buffer.add(ball.astype(np.float32), gl.ARRAY_BUFFER)
    ball_corners = buffer.add(np.array([0, 1, 2, 0, 1, 3], np.uint16), gl.ELEMENT_ARRAY_BUFFER)
    eye = gl.Primitive(attributes=gl.Attributes(POSITION=ball_at), indices=ball_corners)
    nodes = [
        gl.Node(name="armature", children=[1], **(node or {"scale": [0.01] * 3})),
        gl.Node(name="Head", children=[2, *([3] if eyes else [])], translation=[0.0, -1.0, 0.0]),
        gl.Node(name="skin", mesh=0, translation=[0.0, 1.0, 0.0]),
    ]
    if eyes:
        nodes.append(gl.Node(name="Eyeball_L", mesh=1, translation=[3.0, 4.0, 4.0]))
    surface = gl.PbrMetallicRoughness(baseColorFactor=[0.5, 0.3, 0.2, 1.0])
    document = gl.GLTF2(
        asset=gl.Asset(version="2.0"),
        scene=0,
        scenes=[gl.Scene(nodes=[0])],
        nodes=nodes,
        meshes=[gl.Mesh(primitives=[face], extras={"targetNames": list(names)}), gl.Mesh(primitives=[eye])],
        materials=[gl.Material(pbrMetallicRoughness=surface, alphaCutoff=None)],
    )
    document.accessors, document.bufferViews = buffer.accessors, buffer.views
    document.buffers = [gl.Buffer(byteLength=len(buffer.data))]
    document.set_binary_blob(bytes(buffer.data))
    path.write_bytes(b"".join(document.save_to_bytes()))
    return path


def write_obj(path, vertices, triangles):
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices]
    path.write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles)]), encoding="utf-8")


MAPPING = """
channels:
  Mouth_Open: {from: jawOpen, gain: 0.5, offset: 0.1, limit: [0, 0.4]}
  Smile_L: mouthSmileLeft
  Smile_R: {from: {mouthSmileRight: 0.75, cheekSquintRight: 0.25}}
  Blink: {from: {eyeBlinkLeft: 0.5, eyeBlinkRight: 0.5}}
  Frozen: {from: browInnerUp, mute: true}
"""
