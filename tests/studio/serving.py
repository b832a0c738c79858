"""A studio that answers in a thread of this process."""

import http.client
import socket
import threading
import time

import uvicorn
from sentences import project_with_line
from websockets.sync.client import connect

from facesynth.studio.app import studio_app
from facesynth.studio.studio import Studio

TOKEN = "right"  # noqa: S105  # of tests alone


class Served:
    """A studio that answers in a thread of this process."""

    def __init__(self, folder, corpus, performing=None, head=b"glTF"):
        self.project = project_with_line(folder / "project")
        listening = socket.create_server(("127.0.0.1", 0))
        self.port = listening.getsockname()[1]
        path = folder / "head.glb"
        path.write_bytes(head)
        model = folder / "model.safetensors" if performing else None
        app = studio_app(Studio(self.project, corpus, model, performing), TOKEN, self.port, path)
        config = uvicorn.Config(app, log_level="critical", timeout_graceful_shutdown=1, ws="websockets-sansio")
        self.server = uvicorn.Server(config)
        self.thread = threading.Thread(target=self.server.run, kwargs={"sockets": [listening]})
        self.thread.start()
        while not self.server.started:
            time.sleep(0.01)
        self.listening = listening

    def close(self):
        self.server.should_exit = True
        self.thread.join()
        self.listening.close()

    @property
    def host(self):
        return f"127.0.0.1:{self.port}"

    def ask(self, path, method="GET", body=None, **headers):
        """Status, text and headers of an answer; by default of somebody who may come in."""
        given = {"host": self.host, "cookie": f"facesynth-{self.port}={TOKEN}", "origin": f"http://{self.host}", **headers}
        client = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        client.putrequest(method, path, skip_host=True)
        for name, value in given.items():
            if value is not None:
                client.putheader(name.replace("_", "-"), value)
        if body is not None and "content_length" not in headers:
            client.putheader("content-length", str(len(body)))
        client.endheaders(body)
        answer = client.getresponse()
        said = answer.status, answer.read().decode(errors="replace"), dict(answer.headers)
        client.close()
        return said

    def window(self, **headers):
        given = {"Cookie": f"facesynth-{self.port}={TOKEN}", **headers}
        return connect(f"ws://{self.host}/link", origin=f"http://{self.host}", additional_headers=given, max_size=None)
