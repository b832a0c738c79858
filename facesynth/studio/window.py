"""One browser window: what it asks for over its socket, and what it is shown."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from facesynth.inference.errors import FacesynthError
from facesynth.studio.document import Document
from facesynth.studio.library import set_text
from facesynth.studio.messages import face_message, parsed
from facesynth.studio.project import Kept
from facesynth.studio.studio import Studio


@dataclass(frozen=True)
class Wanted:
    """What a window wants to see."""

    line: str
    take: str
    trial: Document | None = None
    """Of a change that is being dragged and not kept; None: the project's own."""
    number: int = 0
    """Of the message that asked, so that the page can tell how long it took."""


class SocketWindow:
    """Answers a page, and shows it the newest of what it wants; what is overtaken is not made."""

    def __init__(self, studio: Studio, socket: WebSocket) -> None:
        self._studio, self._socket = studio, socket
        self._wanted: Wanted | None = None
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
            self._want(Wanted(self._shown.line, self._shown.take))

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
            handler = _OPS.get(message["op"])
            if handler is None:
                raise FacesynthError(f"the studio does nothing called {message['op']!r:.40}")
            answer = await handler(self, message)
            await self.tell({"kind": "answer", "id": number, "ok": True, **(answer or {})})
        except FacesynthError as error:
            await self.tell({"kind": "answer", "id": number, "ok": False, "error": " ".join(str(error).split())})
        except (KeyError, TypeError, ValueError) as error:
            await self.tell(
                {"kind": "answer", "id": number, "ok": False, "error": f"this message is not understood ({error!r:.80})"}
            )

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
        studio = self._studio
        performing = studio.require_performing()
        document = wanted.trial or studio.project.document
        line = document.line(wanted.line)
        take, sound = line.take(wanted.take), studio.project.sound(wanted.line)
        about = {"line": wanted.line, "take": wanted.take, "number": wanted.number, "trial": wanted.trial is not None}
        about["revision"] = studio.project.revision
        shown = await studio.away(performing.whole, sound, document, line, take)
        await self._send(face_message(shown, **about))
        if wanted.trial is None and self._wanted is None:
            rows = await studio.away(performing.explanation, sound, document, line, take)
            await self.tell({"kind": "choices", **about, "rows": rows})

    async def _op_change(self, message: dict[str, Any]) -> dict[str, Any]:
        kept = await self._studio.change(str(message["do"]), dict(message["with"]), message.get("base"))
        return {"revision": kept.revision}

    async def _op_trial(self, message: dict[str, Any]) -> None:
        trial = self._studio.project.trial(str(message["do"]), dict(message["with"]))
        self._want(Wanted(str(message["line"]), str(message["take"]), trial, int(message["id"])))

    async def _op_show(self, message: dict[str, Any]) -> None:
        self._shown = Wanted(str(message["line"]), str(message["take"]), None, int(message["id"]))
        self._studio.project.document.line(self._shown.line).take(self._shown.take)
        self._want(self._shown)

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

    async def _op_cancel(self, message: dict[str, Any]) -> None:
        self._studio.jobs.cancel(int(message["number"]))

    async def _op_check(self, _message: dict[str, Any]) -> dict[str, Any]:
        path = str(self._studio.corpus.path)
        return {"job": self._studio.jobs.start("check the corpus", ["corpus", "check", path, "--json"]).facts()}

    async def _op_align(self, message: dict[str, Any]) -> dict[str, Any]:
        ids = [word for name in message["ids"] for word in ("--id", str(name))]
        force = ["--force"] if message.get("force") is True else []
        arguments = ["corpus", "align", str(self._studio.corpus.path), *ids, *force]
        return {"job": self._studio.jobs.start("place phones anew", arguments).facts()}

    async def _op_train(self, message: dict[str, Any]) -> dict[str, Any]:
        return {"job": self._studio.train(str(message["method"])).facts()}

    async def _op_text(self, message: dict[str, Any]) -> None:
        set_text(self._studio.corpus, str(message["utterance"]), str(message["text"]))


_OPS: Mapping[str, Callable[[SocketWindow, dict[str, Any]], Awaitable[dict[str, Any] | None]]] = {
    name.removeprefix("_op_"): handler for name, handler in vars(SocketWindow).items() if name.startswith("_op_")
}
