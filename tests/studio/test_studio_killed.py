"""A studio that is killed while windows work in it: what they were told to be kept is there when it comes back."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
from http.client import HTTPConnection

import numpy as np
import pytest
from sentences import project_with_line
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from facesynth.studio.project import Project


def cookie_of(host, token):
    client = HTTPConnection(host, timeout=60)
    client.request("GET", f"/?token={token}")
    cookie = client.getresponse().headers["set-cookie"].split(";")[0]
    client.close()
    return cookie


def worked_until_killed(folder, corpus, seconds):
    """Revision that a window was told last, by a studio that is killed after some seconds of changes."""
    command = [sys.executable, "-m", "facesynth", "studio", str(corpus), "--project", str(folder), "--no-browser"]
    studio = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    address = re.search(r"http://\S+", studio.stderr.readline())[0]
    host, told = address.split("/")[2], 0
    given = {"Cookie": cookie_of(host, address.partition("token=")[2])}
    killer = threading.Timer(seconds, os.kill, (studio.pid, signal.SIGKILL))
    try:
        with connect(f"ws://{host}/link", origin=f"http://{host}", additional_headers=given) as window:
            for number in range(100000):
                what = {"line": "hello", "take": "1", "phone": 2, "label": "aa" if number % 2 else "ah"}
                window.send(json.dumps({"op": "change", "id": number, "do": "relabel", "with": what}))
                while (message := json.loads(window.recv())).get("id") != number or message["kind"] != "answer":
                    pass
                told = message["revision"]
                if number == 1:
                    killer.start()
    except ConnectionClosed:
        pass
    studio.communicate()
    return told


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system kills otherwise")
def test_what_a_window_was_told_outlives_the_studio(tmp_path, tiny):
    project_with_line(tmp_path / "p").close()
    rng = np.random.default_rng(0)
    for _ in range(5):
        told = worked_until_killed(tmp_path / "p", tiny.path, rng.uniform(0.2, 1.5))
        assert told > 0
        again = Project.open(tmp_path / "p")
        assert again.revision >= told
        again.close()
