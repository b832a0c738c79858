"""Who may talk to the studio: this machine's browser, with the token of this start, from the studio's own page."""

import hmac
import json
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Message, Receive, Send], Awaitable[None]]

LARGEST_UPLOAD_BYTES = 256 * 2**20
LARGEST_MESSAGE_BYTES = 8 * 2**20
"""Of a WebSocket."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; media-src 'self' blob:;"
    " connect-src 'self' blob:; font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cache-control": "no-store",
}


@dataclass(frozen=True)
class Guard:
    """What stands before the studio; it answers in one line whoever may not come in."""

    app: App
    token: str
    port: int

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """One request, one socket, or the start and end of the server."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        refused = self._fault(scope)
        if refused is not None:
            await _answer(scope, receive, send, *refused)
        elif scope["type"] == "http" and (given := _given_token(scope)):
            await _let_in(send, f"{self._cookie}={given}")
        else:
            await self.app(scope, _limited(receive), _hardened(send))

    def _fault(self, scope: Message) -> tuple[int, str] | None:
        """Status and reason, where somebody may not come in."""
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        if headers.get("host", "") not in self._hosts:
            return 403, f"the studio answers to http://127.0.0.1:{self.port} alone; got the host {headers.get('host', '')!r:.80}"
        origin = headers.get("origin")
        needs_origin = scope["type"] == "websocket" or scope.get("method") not in ("GET", "HEAD")
        if (origin is None and needs_origin) or (origin is not None and origin not in {f"http://{host}" for host in self._hosts}):
            return 403, f"another page may not use the studio; got the origin {origin!r:.80}"
        if not hmac.compare_digest(self._token_of(scope, headers).encode(), self.token.encode()):
            return 403, "the token is wrong or missing; open the address that the studio printed when it started"
        if int(_number(headers.get("content-length", "0"))) > LARGEST_UPLOAD_BYTES:
            return 413, f"a sound may have {LARGEST_UPLOAD_BYTES // 2**20} MB at most; cut it, or compress it"
        return None

    @property
    def _hosts(self) -> tuple[str, str]:
        return f"127.0.0.1:{self.port}", f"localhost:{self.port}"

    @property
    def _cookie(self) -> str:
        return f"facesynth-{self.port}"

    def _token_of(self, scope: Message, headers: dict[str, str]) -> str:
        if given := _given_token(scope):
            return given
        try:
            kept = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return ""
        return kept.value if kept else ""


def _given_token(scope: Message) -> str:
    """The token in the address of the first page."""
    return parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0] if scope["path"] == "/" else ""


def _number(text: str) -> int:
    return int(text) if text.isascii() and text.isdecimal() else 0


async def _let_in(send: Send, cookie: str) -> None:
    """Keep the token in a cookie, out of the address."""
    headers = [(b"location", b"/"), (b"set-cookie", f"{cookie}; Path=/; HttpOnly; SameSite=Strict".encode("latin-1"))]
    await send({"type": "http.response.start", "status": 303, "headers": headers + _as_headers()})
    await send({"type": "http.response.body", "body": b""})


async def _answer(scope: Message, receive: Receive, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 4403, "reason": reason[:120]})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"connection", b"close"), *_as_headers()]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": (reason + "\n").encode()})


def _as_headers() -> list[tuple[bytes, bytes]]:
    return [(name.encode(), value.encode()) for name, value in _HEADERS.items()]


def _hardened(send: Send) -> Send:
    """Every answer says what the page may do."""

    async def hardened(message: Message) -> None:
        if message["type"] == "http.response.start":
            given = {name.lower() for name, _ in message.get("headers", [])}
            added = [(name, value) for name, value in _as_headers() if name not in given]
            message = {**message, "headers": [*message.get("headers", []), *added]}
        await send(message)

    return hardened


class TooLargeError(Exception):
    """An upload without an honest length went on for too long."""


def _limited(receive: Receive) -> Receive:
    """Counts what comes, for a length that is stated may be a lie."""
    come = 0

    async def limited() -> Message:
        nonlocal come
        message = await receive()
        if message["type"] == "http.request":
            come += len(message.get("body", b""))
            if come > LARGEST_UPLOAD_BYTES:
                raise TooLargeError
        return message

    return limited


def as_line(text: str) -> str:
    """A message as JSON in one line."""
    return json.dumps({"error": " ".join(text.split())}, ensure_ascii=False)
