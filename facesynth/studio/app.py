"""The studio's addresses: the page, the head, sounds, what was exported, uploads, and the socket."""

import importlib.util
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import anyio
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from facesynth.corpus.files import check_id
from facesynth.inference.errors import FacesynthError
from facesynth.studio.guard import App, Guard, TooLargeError, as_line
from facesynth.studio.studio import REPORTS, Studio
from facesynth.studio.window import SocketWindow

PAGE = Path(__file__).parent / "page"
_REPORT_POLICY = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; media-src data:"
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}


def three_js() -> Path:
    """three.js as the package nicegui brings it (MIT); FacesynthError where that is not installed."""
    spec = importlib.util.find_spec("nicegui")
    places = spec.submodule_search_locations if spec else None
    path = Path(places[0]) / "elements/scene/dist/index.js" if places else None
    if path is None or not path.is_file():
        raise FacesynthError("the studio's page needs three.js from nicegui 3; run: pip install 'facesynth[studio]'")
    return path


def studio_app(studio: Studio, token: str, port: int, head: Path) -> App:
    """What the server runs. head: a .glb of the head that is shown."""
    pages = {path.name: path for path in sorted(PAGE.iterdir()) if path.suffix in _TYPES}
    routes = [
        Route("/", partial(_page, pages, "index.html")),
        Route("/page/{name}", partial(_named_page, pages)),
        Route("/three.js", partial(_file, three_js(), "text/javascript")),
        Route("/head.glb", partial(_file, head, "model/gltf-binary")),
        Route("/sound/{line}", partial(_sound, studio)),
        Route("/recorded/{utterance}", partial(_recorded_sound, studio)),
        Route("/exports/{name}", partial(_export, studio)),
        Route("/reports/{name}", partial(_report, studio)),
        Route("/upload", partial(_upload, studio), methods=["POST"]),
        WebSocketRoute("/link", partial(_link, studio)),
    ]

    @asynccontextmanager
    async def alive(_app: Starlette) -> AsyncIterator[None]:
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(studio.watch)
            yield
            tasks.cancel_scope.cancel()
        await studio.close()

    return Guard(Starlette(routes=routes, lifespan=alive), token, port)


async def _page(pages: dict[str, Path], name: str, _request: Request) -> Response:
    path = pages[name]
    return Response(path.read_bytes(), media_type=_TYPES[path.suffix])


async def _named_page(pages: dict[str, Path], request: Request) -> Response:
    name = request.path_params["name"]
    if name not in pages:
        return _nothing()
    return await _page(pages, name, request)


async def _file(path: Path, kind: str, _request: Request) -> Response:
    return FileResponse(path, media_type=kind, headers={"cache-control": "private, max-age=3600"})


async def _sound(studio: Studio, request: Request) -> Response:
    name = request.path_params["line"]
    known = any(line.name == name for line in studio.project.document.lines)
    return FileResponse(studio.project.sound(name), media_type="audio/wav") if known else _nothing()


async def _recorded_sound(studio: Studio, request: Request) -> Response:
    utterance = request.path_params["utterance"]
    if utterance not in studio.corpus:
        return _nothing()
    return FileResponse(studio.corpus.files.audio(utterance), media_type="audio/wav")


async def _export(studio: Studio, request: Request) -> Response:
    """A file of the folder of exports, which its name cannot lead out of: it is looked for among what lies there."""
    folder = studio.project.folder / "exports"
    there = {path.name: path for path in folder.iterdir() if path.is_file() and not path.is_symlink()} if folder.is_dir() else {}
    path = there.get(request.path_params["name"])
    return FileResponse(path, filename=path.name) if path else _nothing()


async def _report(studio: Studio, request: Request) -> Response:
    """A report: one page that holds everything in itself, and may do nothing."""
    name = request.path_params["name"]
    if name not in studio.reports():
        return _nothing()
    page = studio.project.folder / REPORTS / name / "index.html"
    return FileResponse(page, media_type="text/html", headers={"content-security-policy": _REPORT_POLICY})


async def _upload(studio: Studio, request: Request) -> Response:
    """A sound or video file, to become a line."""
    name, text = request.query_params.get("name", ""), request.query_params.get("text", "")
    suffix = Path(name).suffix[:10]
    try:
        line = check_id(Path(name).stem)
        with tempfile.TemporaryDirectory(prefix=".upload-", dir=studio.project.folder) as folder:
            path = Path(folder) / f"{line}{suffix if suffix[1:].isalnum() else ''}"
            async with await anyio.open_file(path, "wb") as file:
                async for chunk in request.stream():
                    await file.write(chunk)
            added = await studio.add_sound(line, path, text.strip() or None)
    except TooLargeError:
        return _line(413, "the sound is too large; cut it, or compress it")
    except ClientDisconnect:
        return _line(400, "the upload was broken off")
    except FacesynthError as error:
        return _line(422, str(error))
    return _json({"line": added})


async def _link(studio: Studio, socket: WebSocket) -> None:
    with suppress(anyio.get_cancelled_exc_class()):
        await SocketWindow(studio, socket).run()


def _json(facts: dict[str, Any]) -> Response:
    from starlette.responses import JSONResponse

    return JSONResponse(facts)


def _line(status: int, text: str) -> Response:
    return Response(as_line(text), status, media_type="application/json")


def _nothing() -> Response:
    return PlainTextResponse("there is nothing of this name\n", 404)
