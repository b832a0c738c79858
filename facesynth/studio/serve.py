"""Starting the studio: on this machine alone, with a token of its own."""

import secrets
import socket
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from facesynth.face.animation import FaceAnimation
from facesynth.face.files.gltf.write import write_glb
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import Speech
from facesynth.methods.registry import load
from facesynth.speech.segments import Segment
from facesynth.studio.document import first_take, take_facts
from facesynth.studio.guard import LARGEST_MESSAGE_BYTES
from facesynth.studio.performing import Performing
from facesynth.studio.project import Project, read_facts
from facesynth.studio.studio import Studio

HOST = "127.0.0.1"


def serve(
    folder: Path,
    corpus: Path | None,
    model: Path | None,
    *,
    port: int = 0,
    rig: Path | None = None,
    mapping: Path | None = None,
    lines: Mapping[str, tuple[Speech, Sequence[Segment]]] = MappingProxyType({}),
    opened: Callable[[str], None],
) -> None:
    """Serve a project until somebody ends it. opened: is given the address, with the token, when the studio answers.

    lines: what a project begins with that has none, by name: speech and its words.

    FacesynthError, before anything is served, for what cannot be opened.
    """
    uvicorn = _uvicorn()
    from facesynth.studio.app import studio_app, three_js

    three_js()
    known = read_facts(folder) if folder.is_dir() else {}
    corpus, model = corpus or _path(known.get("corpus")), model or _path(known.get("model"))
    if corpus is None:
        raise FacesynthError(f"{folder} is no project yet; give the corpus that it is about")
    performing = Performing.of(load(model), rig, mapping) if model else None
    project = Project.open(folder, corpus.resolve(), model.resolve() if model else None)
    for name, (speech, words) in lines.items() if not project.revision else ():
        project.keep_sound(name, speech.audio, speech.sample_rate)
        take = take_facts(first_take(speech.phones, words, speech.emotions))
        project.change("add_line", {"name": name, "text": speech.text, "take": take, "utterance": ""})
    token = secrets.token_urlsafe(24)
    with tempfile.TemporaryDirectory(prefix="facesynth-studio-") as shown, _listening(port) as listening:
        head = head_file(Path(shown), performing)
        number = int(listening.getsockname()[1])
        app = studio_app(Studio(project, corpus, model, performing), token, number, head)
        config = uvicorn.Config(
            app, log_level="warning", ws_max_size=LARGEST_MESSAGE_BYTES, server_header=False, timeout_graceful_shutdown=2
        )
        opened(f"http://{HOST}:{number}/?token={token}")
        uvicorn.Server(config).run(sockets=[listening])


def head_file(folder: Path, performing: Performing | None) -> Path:
    """The head at rest as a .glb, for the page."""
    from facesynth.face.rig.arkit_rig import load_head

    head = performing.head if performing else load_head()
    still = np.zeros((1, len(head.names)), np.float32)
    rest = FaceAnimation(tuple(head.names), still, np.zeros((1, 6)), np.zeros((1, 2)), np.zeros(1), 30.0)
    write_glb(folder / "head.glb", rest, head)
    return folder / "head.glb"


def _listening(port: int) -> socket.socket:
    """A socket of this machine alone."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((HOST, port))
        listening.listen()  # a browser that is quicker than the server waits in line
    except OSError as error:
        listening.close()
        raise FacesynthError(f"port {port} cannot be used ({error.strerror}); give another --port, or none") from None
    return listening


def _path(text: str | None) -> Path | None:
    return Path(text) if text else None


def _uvicorn() -> Any:
    try:
        import uvicorn
    except ImportError:
        raise FacesynthError("the studio is not installed; run: pip install 'facesynth[studio]'") from None
    return uvicorn
