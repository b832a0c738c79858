"""What a window asks of maps, and how it is answered."""

from collections.abc import Awaitable, Callable, Mapping
from typing import Any

import numpy as np

from facesynth.inference.motion import Motion
from facesynth.studio.messages import face_message, packed
from facesynth.studio.node_maps import highlights, left_by, map_facts, picture, recorded_at
from facesynth.studio.studio import Studio

Reply = Callable[[bytes], Awaitable[None]]
Question = dict[str, Any]


async def show_map(studio: Studio, asked: Question, reply: Reply) -> None:
    """Nodes, points and the picture of a map."""
    maps = studio.require_maps()

    def made() -> list[bytes]:
        found = maps.map(str(asked["phone"]), str(asked["map"]))
        pixels = picture(found, asked["size"], left_by(found, asked))
        height, width = pixels.shape[:2]
        size = {"width": width, "height": height, "extent": found.plane.extent((width, height))}
        about = {**map_facts(found), "shown": left_by(found, asked).tolist()}
        named = {"phone": about["phone"], "map": about["map"]}
        return [packed({"kind": "map", **about}, found.plane.points), packed({"kind": "map_picture", **named, **size}, pixels)]

    for message in await studio.away(made):
        await reply(message)


async def highlight(studio: Studio, asked: Question, reply: Reply) -> None:
    """Where nodes fit in time and between neighbours."""
    maps = studio.require_maps()

    def made() -> bytes:
        found = maps.map(str(asked["phone"]), str(asked["map"]))
        facts, places = highlights(found, float(asked["progress"]), str(asked["before"]), str(asked["after"]))
        return packed({"kind": "map_highlights", "phone": asked["phone"], "map": asked["map"], **facts}, places)

    await reply(await studio.away(made))


async def pick(studio: Studio, asked: Question, reply: Reply) -> dict[str, Any]:
    """The face at a place of a map."""
    maps, performing = studio.require_maps(), studio.require_performing()

    def made() -> tuple[bytes, dict[str, Any]]:
        found = maps.picked(str(asked["phone"]), str(asked["map"]), asked["place"])
        shown = performing.of_frames(found.frame, performing.model.fps)
        return face_message(shown, picked=int(asked["id"])), {"inside": found.inside, "node": found.node}

    message, facts = await studio.away(made)
    await reply(message)
    return facts


async def play_node(studio: Studio, asked: Question, reply: Reply) -> None:
    """The motion of a node on the face."""
    maps, performing = studio.require_maps(), studio.require_performing()

    def made() -> bytes:
        frames, fps = maps.frames(str(asked["phone"]), str(asked["map"]), str(asked["node"]))
        return face_message(performing.of_frames(frames, fps), node=asked["node"])

    await reply(await studio.away(made))


async def draw(studio: Studio, asked: Question, reply: Reply) -> dict[str, Any]:
    """The motion of a path on the face; kept as a node of the project where `keep` says so."""
    maps, performing = studio.require_maps(), studio.require_performing()

    def made() -> tuple[Any, float, bytes]:
        drawn, fps = maps.drawn(str(asked["phone"]), str(asked["map"]), asked["path"], float(asked["duration_s"]))
        return drawn, fps, face_message(performing.of_frames(drawn.frames, fps), node="")

    drawn, fps, message = await studio.away(made)
    await reply(message)
    if asked.get("keep") is True:
        frames = _at_corpus_rate(Motion(drawn.frames, fps, performing.model.fitted_layout), studio.corpus.fps)
        node = {"title": str(asked["title"]), "phone": str(asked["phone"]), "emotion": str(asked["emotion"]), "frames": frames}
        await studio.change("draw_node", node, asked.get("base"))
    return {"outside": drawn.outside, "frames": len(drawn.frames)}


async def where(studio: Studio, asked: Question, _reply: Reply) -> dict[str, Any]:
    """Where a node was recorded."""
    return recorded_at(studio.corpus, str(asked["node"]))


def _at_corpus_rate(motion: Motion, fps: float) -> list[list[float]]:
    from facesynth.motion.resample import resample

    return [[float(value) for value in frame] for frame in np.asarray(resample(motion, fps).frames)]


QUESTIONS: Mapping[str, Callable[[Studio, Question, Reply], Awaitable[dict[str, Any] | None]]] = {
    "map": show_map,
    "highlight": highlight,
    "pick": pick,
    "play_node": play_node,
    "draw": draw,
    "where": where,
}
