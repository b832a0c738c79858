"""What the morph targets of a mesh are called: exporters keep the names in a handful of places."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import pygltflib as gl

AGAIN = " ({})"
"""Behind a name that stands there for the second time, with its number."""


def target_names(document: gl.GLTF2, mesh: int) -> tuple[str, ...]:
    """Names of a mesh's morph targets, each once; what a VRM avatar expresses with one that has no name; else numbers."""
    return _each_once(_names(document, mesh))


def names_twice(document: gl.GLTF2, mesh: int) -> tuple[str, ...]:
    """Names that several morph targets of a mesh have."""
    return tuple(name for name, count in Counter(_names(document, mesh)).items() if count > 1)


def _names(document: gl.GLTF2, mesh: int) -> list[str]:
    found = document.meshes[mesh]
    count = max((len(primitive.targets or []) for primitive in found.primitives), default=0)
    places = [_listed(found.extras), *(_listed(primitive.extras) for primitive in found.primitives)]
    places += [_listed(node.extras) for node in document.nodes if node.mesh == mesh]
    places += [names for primitive in found.primitives for names in (_of_targets(primitive), _of_accessors(document, primitive))]
    expressed = dict(_expressions(document, mesh))
    given = [next((names[k] for names in places if k < len(names) and names[k]), "") for k in range(count)]
    return [name or expressed.get(k) or f"target_{k}" for k, name in enumerate(given)]


def _each_once(names: list[str]) -> tuple[str, ...]:
    seen = Counter[str]()
    unique = []
    for name in names:
        seen[name] += 1
        unique.append(name if seen[name] == 1 else name + AGAIN.format(seen[name]))
    return tuple(unique)


def _listed(extras: Any) -> list[str]:
    names = extras.get("targetNames") if isinstance(extras, Mapping) else None
    return [str(name) for name in names] if isinstance(names, (list, tuple)) else []


def _of_targets(primitive: gl.Primitive) -> list[str]:
    """Names in the targets' own extras."""
    extras = [_get(target, "extras") for target in primitive.targets or []]
    return [str(one.get("name") or "") if isinstance(one, Mapping) else "" for one in extras]


def _of_accessors(document: gl.GLTF2, primitive: gl.Primitive) -> list[str]:
    """Names of the accessors of positions, where no two targets share one."""
    places = [_get(target, "POSITION") for target in primitive.targets or []]
    names = [str(document.accessors[place].name or "") if isinstance(place, int) else "" for place in places]
    return names if len(set(names)) == len(names) else []


def _get(target: Any, key: str) -> Any:
    return target.get(key) if isinstance(target, dict) else getattr(target, key, None)


def expressions(document: gl.GLTF2) -> dict[str, dict[str, float]]:
    """What a VRM avatar's expressions consist of: by their name, the share of each morph target by its name."""
    names = {mesh: target_names(document, mesh) for mesh in range(len(document.meshes))}
    found: dict[str, dict[str, float]] = {}
    for name, binds in _binds(document):
        shares = {names[mesh][index]: weight for mesh, index, weight in binds if 0 <= index < len(names.get(mesh, ()))}
        found.setdefault(name, {}).update(shares)
    return found


def _expressions(document: gl.GLTF2, mesh: int) -> Iterator[tuple[int, str]]:
    """Number of a target and the expression of a VRM avatar (0.x, then 1.0) that consists of it alone."""
    yield from ((binds[0][1], name) for name, binds in _binds(document) if len(binds) == 1 and binds[0][0] == mesh)


def _binds(document: gl.GLTF2) -> Iterator[tuple[str, list[tuple[int, int, float]]]]:
    """Each expression's name with mesh, number and share (0 to 1) of the targets that it consists of."""
    extensions = document.extensions or {}
    for group in (extensions.get("VRM") or {}).get("blendShapeMaster", {}).get("blendShapeGroups", []):
        preset = str(group.get("presetName") or "")
        binds = [
            (bind.get("mesh"), int(bind["index"]), float(bind.get("weight", 100)) / 100) for bind in group.get("binds") or []
        ]
        yield str(group.get("name") or "") if preset in ("", "unknown") else preset, binds
    given = (extensions.get("VRMC_vrm") or {}).get("expressions", {})
    for kind in ("custom", "preset"):
        for name, expression in (given.get(kind) or {}).items():
            morphs = expression.get("morphTargetBinds") or []
            yield (
                str(name),
                [(document.nodes[one["node"]].mesh, int(one["index"]), float(one.get("weight", 1.0))) for one in morphs],
            )
