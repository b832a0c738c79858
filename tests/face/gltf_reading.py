"""What a viewer would show of a .glb at a frame of its animation, worked out from the file alone."""

import numpy as np
import pygltflib as gl
from scipy.spatial.transform import Rotation

DTYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def played(path, k):
    """[V, 3] world positions of all primitives, morphed and placed as the last animation says at its key k."""
    document = gl.GLTF2().load_binary(str(path))
    data = document.binary_blob()

    def array(index):
        accessor = document.accessors[index]
        view = document.bufferViews[accessor.bufferView]
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        count = accessor.count * WIDTHS[accessor.type]
        return np.frombuffer(data, DTYPES[accessor.componentType], count, start).reshape(accessor.count, -1).astype(float)

    state = {}
    for channel in document.animations[-1].channels:
        sampler = document.animations[-1].samplers[channel.sampler]
        keys = len(array(sampler.input))
        state[channel.target.node, channel.target.path] = array(sampler.output).reshape(keys, -1)[k]

    def local(index):
        node = document.nodes[index]
        if node.matrix is not None and (index, "rotation") not in state:
            return np.array(node.matrix).reshape(4, 4).T
        matrix = np.eye(4)
        turn = state.get((index, "rotation"), node.rotation or [0, 0, 0, 1])
        matrix[:3, :3] = Rotation.from_quat(turn).as_matrix() * np.asarray(node.scale or [1, 1, 1], float)
        matrix[:3, 3] = state.get((index, "translation"), node.translation or [0, 0, 0])
        return matrix

    found = {}

    def visit(index, parent):
        place = parent @ local(index)
        node = document.nodes[index]
        for primitive in [] if node.mesh is None else document.meshes[node.mesh].primitives:
            points = array(primitive.attributes.POSITION)
            for target, weight in zip(primitive.targets or [], state.get((index, "weights"), []), strict=False):
                position = target["POSITION"] if isinstance(target, dict) else target.POSITION
                points = points + weight * array(position)
            found.setdefault(index, []).append(points @ place[:3, :3].T + place[:3, 3])
        for child in node.children or []:
            visit(child, place)

    for root in document.scenes[document.scene or 0].nodes:
        visit(root, np.eye(4))
    return np.concatenate([points for index in sorted(found) for points in found[index]])
