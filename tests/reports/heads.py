"""Heads as exporters and games write them: the mask of `own_heads` under other names, in other containers and with oddities."""

import io

import numpy as np
import pygltflib as gl
from own_heads import mask, write_mask
from PIL import Image

TALKING = ("jawOpen", "mouthSmileLeft", "mouthSmileRight", "browInnerUp", "Frozen")


def head(path, change=None, names=TALKING, **options):
    """The mask with the names given to its five shapes; change: a function of its document and its data."""
    made = path.with_suffix(".glb")
    write_mask(made, names, **options)
    document = gl.GLTF2().load_binary(str(made))
    data = bytearray(document.binary_blob())
    if change is not None:
        change(document, data)
    document.buffers[0].byteLength = len(data)
    document.set_binary_blob(bytes(data))
    made.unlink()
    path.write_bytes(b"".join(document.save_to_bytes()))
    return path


def laid(document, data, array):
    """The accessor of one more array."""
    data.extend(b"\0" * (-len(data) % 4))
    start = len(data)
    data.extend(array.tobytes())
    kinds = {"<f4": (gl.FLOAT, "VEC2"), "<u2": (gl.UNSIGNED_SHORT, "SCALAR")}
    kind, width = kinds[array.dtype.str]
    document.bufferViews.append(gl.BufferView(buffer=0, byteOffset=start, byteLength=len(data) - start))
    document.accessors.append(
        gl.Accessor(bufferView=len(document.bufferViews) - 1, componentType=kind, count=len(array), type=width)
    )
    return len(document.accessors) - 1


def nameless(document):
    """Take the names from where the mask keeps them."""
    found = document.meshes[0].extras["targetNames"]
    document.meshes[0].extras = {}
    return found


def vrm0(document, _data):
    names = nameless(document)
    binds = [("a", 0), ("i", 1), ("blink", 4)]
    groups = [{"name": n.upper(), "presetName": n, "binds": [{"mesh": 0, "index": k, "weight": 100}]} for n, k in binds]
    bones = [{"bone": "head", "node": 1}]
    document.extensions = {"VRM": {"blendShapeMaster": {"blendShapeGroups": groups}, "humanoid": {"humanBones": bones}}}
    document.nodes[0].rotation = [0.0, 1.0, 0.0, 0.0]  # it looks along -z
    return names


def vrm1(document, _data):
    nameless(document)
    binds = [("aa", 0), ("ih", 1), ("blink", 4)]
    preset = {name: {"morphTargetBinds": [{"node": 2, "index": k, "weight": 1.0}]} for name, k in binds}
    document.extensions = {"VRMC_vrm": {"expressions": {"preset": preset}, "humanoid": {"humanBones": {"head": {"node": 1}}}}}


def names_in_primitive(document, _data):
    document.meshes[0].primitives[0].extras = {"targetNames": nameless(document)}


def names_in_node(document, _data):
    document.nodes[2].extras = {"targetNames": nameless(document)}


def names_in_targets(document, _data):
    for target, name in zip(document.meshes[0].primitives[0].targets, nameless(document), strict=True):
        target["extras"] = {"name": name}


def names_in_accessors(document, _data):
    for target, name in zip(document.meshes[0].primitives[0].targets, nameless(document), strict=True):
        place = target["POSITION"] if isinstance(target, dict) else target.POSITION
        document.accessors[place].name = name


def as_strips(document, data):
    """The mask as one triangle strip, rows joined by triangles without an area."""
    side = round(len(mask()[0]) ** 0.5)
    corner = np.arange(side * side).reshape(side, side)
    strip = []
    for row in range(side - 1):
        zigzag = np.stack([corner[row], corner[row + 1]], axis=1)[:, ::-1].ravel().tolist()
        strip += [strip[-1], strip[-1], zigzag[0]] if strip and len(strip) % 2 else [strip[-1], zigzag[0]] if strip else []
        strip += zigzag
    primitive = document.meshes[0].primitives[0]
    primitive.indices, primitive.mode = laid(document, data, np.array(strip, "<u2")), gl.TRIANGLE_STRIP


def textured(kind):
    """A texture of one colour, in PNG's place or in an extension's."""

    def change(document, data):
        vertices = mask()[0]
        uv = np.full((len(vertices), 2), 0.5, "<f4")
        document.meshes[0].primitives[0].attributes.TEXCOORD_0 = laid(document, data, uv)
        content = io.BytesIO()
        if kind == "webp":
            Image.new("RGB", (8, 8), (0, 200, 0)).save(content, "WEBP", lossless=True)
        picture = content.getvalue() or b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(64)
        start = len(data)
        data.extend(picture)
        document.bufferViews.append(gl.BufferView(buffer=0, byteOffset=start, byteLength=len(picture)))
        document.images = [gl.Image(bufferView=len(document.bufferViews) - 1, mimeType=f"image/{kind}")]
        extension = {"webp": "EXT_texture_webp", "ktx2": "KHR_texture_basisu"}[kind]
        document.textures = [gl.Texture(extensions={extension: {"source": 0}})]
        document.extensionsUsed = document.extensionsRequired = [extension]
        document.materials[0].pbrMetallicRoughness.baseColorTexture = gl.TextureInfo(index=0)

    return change


def outside(document, _data):
    """A second mesh that no scene shows."""
    document.nodes.append(gl.Node(name="spare", mesh=1, translation=[90.0, 0.0, 0.0]))


def teeth_on_a_jaw(document, data):
    """Teeth without shapes, in a node under a jaw's joint at the ears."""
    side = np.array([[-2, 0, 0], [2, 0, 0], [0, 0, 2]], "<f4")
    data.extend(b"\0" * (-len(data) % 4))
    start = len(data)
    data.extend(side.tobytes())
    document.bufferViews.append(gl.BufferView(buffer=0, byteOffset=start, byteLength=side.nbytes))
    document.accessors.append(gl.Accessor(bufferView=len(document.bufferViews) - 1, componentType=gl.FLOAT, count=3, type="VEC3"))
    document.accessors[-1].min, document.accessors[-1].max = side.min(axis=0).tolist(), side.max(axis=0).tolist()
    position = len(document.accessors) - 1
    corners = laid(document, data, np.array([0, 1, 2], "<u2"))
    primitive = gl.Primitive(attributes=gl.Attributes(POSITION=position), indices=corners)
    document.meshes.append(gl.Mesh(primitives=[primitive]))
    first = len(document.nodes)
    document.nodes[1].children.append(first)
    document.nodes += [
        gl.Node(name="CC_Base_JawRoot", translation=[0.0, -1.0, -6.0], children=[first + 1]),
        gl.Node(name="Teeth", mesh=len(document.meshes) - 1, translation=[0.0, -3.0, 9.0]),
    ]


def vrm0_mixing(document, _data):
    """An avatar whose morph targets have names of their own, and whose expressions mix several."""
    document.meshes[0].extras = {"targetNames": ["kuchi_tate", "kuchi_yoko", "kuchi_maru", "mabuta", "hoho"]}
    mixed = {"a": [(0, 80), (1, 30)], "o": [(0, 40), (2, 100)], "blink": [(3, 100)]}
    groups = [
        {"name": name.upper(), "presetName": name, "binds": [{"mesh": 0, "index": k, "weight": share} for k, share in binds]}
        for name, binds in mixed.items()
    ]
    document.extensions = {"VRM": {"blendShapeMaster": {"blendShapeGroups": groups}}}


def vrm1_mixing(document, _data):
    document.meshes[0].extras = {"targetNames": ["m1", "m2", "m3", "m4", "m5"]}
    mixed = {"aa": [(0, 0.8), (1, 0.3)], "oh": [(0, 0.4), (2, 1.0)], "blink": [(3, 1.0)]}
    preset = {
        name: {"morphTargetBinds": [{"node": 2, "index": k, "weight": share} for k, share in binds]}
        for name, binds in mixed.items()
    }
    document.extensions = {"VRMC_vrm": {"expressions": {"preset": preset}}}


def mirrored(document, _data):
    """A root that mirrors the head, as some exporters do."""
    document.nodes[0].scale = [-(document.nodes[0].scale or [1, 1, 1])[0], *(document.nodes[0].scale or [1, 1, 1])[1:]]


def in_another_scene(document, _data):
    """A scene of a camera alone, which is the file's own, before that of the head."""
    document.nodes.append(gl.Node(name="camera"))
    document.scenes.insert(0, gl.Scene(nodes=[len(document.nodes) - 1]))
    document.scene = 0


def compressed(document, _data):
    """Points that stand in Draco's extension alone, which the file only says it uses."""
    primitive = document.meshes[0].primitives[0]
    primitive.extensions = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    document.accessors[primitive.attributes.POSITION].bufferView = None
    document.extensionsUsed = ["KHR_draco_mesh_compression"]


def halves(where, shift=0.0):
    """A texture that is red on its left and green on its right, in `where`; the face looks at its left, shifted."""

    def change(document, data):
        uv = np.full((len(mask()[0]), 2), (0.25, 0.5), "<f4")
        document.meshes[0].primitives[0].attributes.TEXCOORD_0 = laid(document, data, uv)
        picture = Image.new("RGB", (8, 8), (200, 0, 0))
        picture.paste((0, 200, 0), (4, 0, 8, 8))
        picture.save(where)
        document.images = [gl.Image(uri=where.name.replace(" ", "%20"))]
        document.textures = [gl.Texture(source=0)]
        moved = {"KHR_texture_transform": {"offset": [shift, 0.0]}} if shift else {}
        document.materials[0].pbrMetallicRoughness.baseColorTexture = gl.TextureInfo(index=0, extensions=moved)

    return change
