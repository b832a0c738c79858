"""Pages of the examples in a real browser with the network cut off, and what npm brings for them."""

import fcntl
import functools
import http.server
import json
import os
import shutil
import signal
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
WAIT_S = 90


def installed(example):
    """The example's folder with what npm installs; skips where that cannot be had. Processes beside this one wait for it."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("npm is not installed")
    folder = EXAMPLES / example
    with (folder / "package.json").open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        if not (folder / "node_modules" / ".package-lock.json").is_file():  # what npm writes last
            command = [npm, "install", "--no-audit", "--no-fund", "--ignore-scripts"]
            done = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True, timeout=1800)
            if done.returncode:
                pytest.skip(f"npm cannot install onnxruntime-web here: {done.stderr.strip()[-200:]}")
    return folder


def said_by_node(script, *arguments):
    """What a script of the Node example prints, read as JSON."""
    command = [shutil.which("node"), script, *map(str, arguments)]
    done = subprocess.run(command, cwd=installed("node"), check=False, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def a_browser():
    """Chromium, or a skip where there is none."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        pytest.skip("no Chromium is installed (apt-get install chromium)")
    return browser


class Site(http.server.SimpleHTTPRequestHandler):
    """Serves the page and takes its report."""

    def log_message(self, *_):
        pass

    def do_POST(self):
        self.server.report = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()
        self.server.reported.set()


def visited(browser, site, scratch, page="index.html", flags=(), wait_s=WAIT_S):
    """What a page reports. Every other host than this machine is unknown to the browser."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Site, directory=str(site)))
    server.reported, server.report = threading.Event(), {"error": f"no report within {wait_s} s"}
    threading.Thread(target=server.serve_forever, daemon=True).start()
    command = [browser, "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", f"--user-data-dir={scratch / 'profile'}"]
    command += ["--enable-unsafe-swiftshader", "--no-first-run", "--disable-background-networking"]
    command += ["--proxy-server=127.0.0.1:9", "--proxy-bypass-list=127.0.0.1"]
    command += ["--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1", *flags]
    command += [f"http://127.0.0.1:{server.server_port}/{page}"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, start_new_session=True, **quiet)
    try:
        server.reported.wait(wait_s)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        server.shutdown()
        server.server_close()
    return server.report


def colours(path):
    from PIL import Image

    with Image.open(path) as picture:
        return len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0))
