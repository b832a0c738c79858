"""One browser window: what it asks for over its socket, and what it is shown."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, floor
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from facesynth.inference.errors import FacesynthError
from facesynth.studio.document import Document
from facesynth.studio.map_questions import QUESTIONS
from facesynth.studio.messages import face_message, parsed
from facesynth.studio.performing import Performing
from facesynth.studio.project import Kept
from facesynth.studio.studio import Studio

NEAR_S = 0.5
"""Before and after the playhead, what is made first."""
DRAGGED_S = 0.15
"""The same while something is dragged: the face at the playhead follows, the rest when the pointer rests."""
RESTS_S = 0.08
"""So long nothing new was asked for when the pointer rests."""
LONGEST_S = 1e6
"""Further than that no line goes, whatever a page says."""
BATCH_S = 4
"""So much is made at once after that."""


@dataclass(frozen=True)
class Wanted:
    """What a window wants to see."""

    line: str
    take: str
    trial: Document | None = None
    """Of a change that is being dragged and not kept; None: the project's own."""
    at_s: float = 0.0
    """The playhead, s."""
    sight_s: tuple[float, float] = (0.0, 0.0)
    """Start and end of what the timeline shows."""
    number: int = 0
    """Of the message that asked, so that the page can tell how long it took."""


class SocketWindow:
    """Answers a page, and shows it the newest of what it wants; what is overtaken is not made."""

    def __init__(self, studio: Studio, socket: WebSocket) -> None:
        self._studio, self._socket = studio, socket
        self._wanted: Wanted | None = None
        self._fresh: dict[tuple[Performing, str, str], dict[int, int]] = {}
        """Of each take, the generation at which each second of it was sent last."""
        self._shown: Wanted | None = None
        self._news = asyncio.Event()
        self._sending = asyncio.Lock()

    async def run(self) -> None:
        """Until the window is closed."""
        await self._socket.accept()
        self._studio.windows.add(self)
        showing = asyncio.create_task(self._show())
        try:
            await self.tell(self._studio.facts())
            while True:
                await self._answer(await self._socket.receive_text())
        except WebSocketDisconnect:
            pass
        finally:
            self._studio.windows.discard(self)
            showing.cancel()

    async def tell(self, message: Mapping[str, Any]) -> None:
        """Send a message; a window that is gone is passed over."""
        await self._send(json.dumps(message, ensure_ascii=False))

    def refresh(self, kept: Kept) -> None:
        """Show anew what a change may have changed."""
        if self._shown is not None and (kept.nodes or self._shown.line in kept.lines):
            self._want(replace(self._shown, number=0))

    async def _send(self, message: str | bytes) -> None:
        async with self._sending:
            try:
                await (self._socket.send_text(message) if isinstance(message, str) else self._socket.send_bytes(message))
            except (WebSocketDisconnect, RuntimeError):  # the window was closed while this was made
                self._studio.windows.discard(self)

    async def _answer(self, text: str) -> None:
        number: Any = None
        try:
            message = parsed(text)
            number = message.get("id")
            answer = await self._done(message)
            await self.tell({"kind": "answer", "id": number, "ok": True, **(answer or {})})
        except FacesynthError as error:
            await self.tell({"kind": "answer", "id": number, "ok": False, "error": " ".join(str(error).split())})
        except (KeyError, TypeError, ValueError) as error:
            await self.tell(
                {"kind": "answer", "id": number, "ok": False, "error": f"this message is not understood ({error!r:.80})"}
            )

    async def _done(self, message: dict[str, Any]) -> dict[str, Any] | None:
        if (question := QUESTIONS.get(message["op"])) is not None:
            return await question(self._studio, message, self._send)
        if (handler := _OPS.get(message["op"])) is None:
            raise FacesynthError(f"the studio does nothing called {message['op']!r:.40}")
        return await handler(self, message)

    def _want(self, wanted: Wanted) -> None:
        self._wanted = wanted
        self._news.set()

    async def _show(self) -> None:
        """Make what is wanted, the newest first and alone."""
        while True:
            await self._news.wait()
            self._news.clear()
            wanted, self._wanted = self._wanted, None
            if wanted is None:
                continue
            try:
                await self._show_one(wanted)
            except FacesynthError as error:
                await self.tell({"kind": "note", "lines": [f"{wanted.line}, take {wanted.take}: {error}"]})

    async def _show_one(self, wanted: Wanted) -> None:
        """What is near the playhead first, then what is in sight, then the rest; given up for what is newer."""
        studio = self._studio
        performing = studio.require_performing()
        document = wanted.trial or studio.project.document
        line = document.line(wanted.line)
        take, sound = line.take(wanted.take), studio.project.sound(wanted.line)
        about = {"line": wanted.line, "take": wanted.take, "number": wanted.number, "trial": wanted.trial is not None}
        about["revision"] = studio.project.revision
        now = await studio.away(performing.change, sound, studio.project.edits, line, take)
        pieces = self._fresh.setdefault((performing, wanted.line, wanted.take), {})
        order = near_first(now.speech.duration_s, wanted.at_s, wanted.sight_s)
        if wanted.trial is not None:
            order = [order[0]]
            at_s = min(wanted.at_s, now.speech.duration_s)
            shown = await studio.away(performing.stretch, now, max(at_s - DRAGGED_S, 0.0), at_s + DRAGGED_S)
            await self._send(face_message(shown, last=False, **about))
            if await self._overtaken():
                return
        batches = [batch for batch in order if any(performing.stale(pieces.get(k, 0), k, k + 1) for k in batch)] or order[:1]
        generation = performing.generation
        for number, batch in enumerate(batches, start=1):
            if self._wanted is not None and number > 1:
                return
            shown = await studio.away(performing.stretch, now, float(batch.start), float(batch.stop))
            await self._send(face_message(shown, last=number == len(batches), **about))
            pieces |= dict.fromkeys(batch, generation)
        if wanted.trial is None and self._wanted is None:
            await self.tell({"kind": "choices", **about, "rows": await studio.away(now.draft.choices)})

    async def _overtaken(self) -> bool:
        """Whether something newer is wanted before the pointer rests."""
        try:
            await asyncio.wait_for(self._news.wait(), RESTS_S)
        except TimeoutError:
            return False
        return True

    async def _op_change(self, message: dict[str, Any]) -> dict[str, Any]:
        if self._shown is not None and "at" in message:
            self._shown = replace(self._shown, **_sight(message))
        kept = await self._studio.change(str(message["do"]), dict(message["with"]), message.get("base"))
        return {"revision": kept.revision}

    async def _op_trial(self, message: dict[str, Any]) -> None:
        trial = self._studio.project.trial(str(message["do"]), dict(message["with"]))
        self._want(_wanted(message, trial))

    async def _op_show(self, message: dict[str, Any]) -> None:
        self._shown = _wanted(message, None)
        self._studio.project.document.line(self._shown.line).take(self._shown.take)
        self._want(self._shown)

    async def _op_next_best(self, message: dict[str, Any]) -> dict[str, Any]:
        rows = await self._studio.next_best(str(message["line"]), str(message["take"]), int(message["phone"]))
        return {"rows": rows}

    async def _op_compare(self, message: dict[str, Any]) -> None:
        """Another take, as a ghost."""
        shown = await self._studio.show(str(message["line"]), str(message["take"]))
        await self._send(face_message(shown, line=message["line"], take=message["take"], ghost=True))

    async def _op_recording(self, message: dict[str, Any]) -> None:
        shown = await self._studio.show_recording(str(message["utterance"]))
        await self._send(face_message(shown, utterance=message["utterance"]))

    async def _op_add_utterance(self, message: dict[str, Any]) -> dict[str, Any]:
        return {"line": await self._studio.add_utterance(str(message["utterance"]), message.get("base"))}

    async def _op_export(self, message: dict[str, Any]) -> dict[str, Any]:
        job = self._studio.export(str(message["line"]), str(message["take"]), [str(s) for s in message["suffixes"]])
        return {"job": job.facts()}

    async def _op_keep_edits(self, _message: dict[str, Any]) -> dict[str, Any]:
        return {"count": await self._studio.keep_edits()}

    async def _op_cancel(self, message: dict[str, Any]) -> None:
        self._studio.jobs.cancel(int(message["number"]))

    async def _op_check(self, _message: dict[str, Any]) -> dict[str, Any]:
        path = str(self._studio.corpus.path)
        return {"job": self._studio.jobs.start("check the corpus", ["corpus", "check", path, "--json"]).facts()}

    async def _op_suspects(self, _message: dict[str, Any]) -> dict[str, Any]:
        model = ["--model", str(self._studio.model)] if self._studio.model else []
        arguments = ["corpus", "edit", "suspects", str(self._studio.corpus.path), *model, "--json"]
        return {"job": self._studio.jobs.start("find suspicious nodes", arguments).facts()}

    async def _op_align(self, message: dict[str, Any]) -> dict[str, Any]:
        ids = [word for name in message["ids"] for word in ("--id", str(name))]
        force = ["--force"] if message.get("force") is True else []
        arguments = ["corpus", "align", str(self._studio.corpus.path), *ids, *force]
        return {"job": self._studio.jobs.start("place phones anew", arguments).facts()}

    async def _op_train(self, message: dict[str, Any]) -> dict[str, Any]:
        return {"job": self._studio.train(str(message["method"])).facts()}

    async def _op_evaluate(self, message: dict[str, Any]) -> dict[str, Any]:
        folds, references = int(message["folds"]), message["references"] is True
        return {"job": self._studio.evaluate(str(message["method"]), folds, references).facts()}

    async def _op_text(self, message: dict[str, Any]) -> None:
        await self._studio.set_text(str(message["utterance"]), str(message["text"]))


_OPS: Mapping[str, Callable[[SocketWindow, dict[str, Any]], Awaitable[dict[str, Any] | None]]] = {
    name.removeprefix("_op_"): handler for name, handler in vars(SocketWindow).items() if name.startswith("_op_")
}


def _wanted(message: dict[str, Any], trial: Document | None) -> Wanted:
    return Wanted(str(message["line"]), str(message["take"]), trial, number=int(message["id"]), **_sight(message))


def _sight(message: dict[str, Any]) -> dict[str, Any]:
    """The playhead and what the timeline shows, seconds."""
    at_s, start_s, end_s = (min(max(float(message.get(name, 0)), 0.0), LONGEST_S) for name in ("at", "from", "to"))
    return {"at_s": at_s, "sight_s": (start_s, end_s)}


def near_first(duration_s: float, at_s: float, sight_s: tuple[float, float]) -> list[range]:
    """Seconds of a take in the order in which they are made: around the playhead, in sight, the rest; together all of them."""
    count = max(ceil(duration_s), 1)
    first = range(min(max(floor(at_s - NEAR_S), 0), count - 1), min(max(ceil(at_s + NEAR_S), 1), count))
    seen = range(max(floor(sight_s[0]), 0), min(ceil(sight_s[1]), count))
    order: list[range] = [first]
    made = set(first)
    for stretch in (seen, range(count)):
        for start in range(stretch.start, stretch.stop, BATCH_S):
            order += _runs([k for k in range(start, min(start + BATCH_S, stretch.stop)) if k not in made])
            made |= set(range(start, min(start + BATCH_S, stretch.stop)))
    return order


def _runs(numbers: list[int]) -> list[range]:
    """Numbers that follow one another, as ranges."""
    cuts = [0, *(i for i in range(1, len(numbers)) if numbers[i] != numbers[i - 1] + 1), len(numbers)]
    return [range(numbers[a], numbers[b - 1] + 1) for a, b in pairwise(cuts) if b > a]
