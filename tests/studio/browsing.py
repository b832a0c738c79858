"""A studio as a person starts it, and a real browser that sees nothing else."""

import os
import re
import shutil
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # the network is cut
)


@contextmanager
def started(*arguments, within_s=180):
    """`facesynth studio ARGUMENTS`; gives the address that it prints."""
    command = [sys.executable, "-m", "facesynth", "studio", *map(str, arguments), "--no-browser"]
    studio = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    said = []

    def listen():
        said.extend(iter(studio.stderr.readline, ""))

    listening = threading.Thread(target=listen)
    listening.start()
    try:
        stop = time.monotonic() + within_s
        while not (found := re.search(r"http://\S+", "".join(said))):
            assert studio.poll() is None, "".join(said)
            assert time.monotonic() < stop, "the studio did not start"
            time.sleep(0.05)
        yield found[0]
    finally:
        studio.terminate()
        studio.wait(timeout=30)
        listening.join()
        studio.stderr.close()


def missing(why):
    """A skip that says why; where machines test (CI is set) it is a failure: there the page must be seen."""
    (pytest.fail if os.environ.get("CI") else pytest.skip)(why)


@contextmanager
def browser():
    """Chromium without a screen; see `missing` where there is none."""
    try:
        from playwright import sync_api as playwright
    except ImportError:
        missing("playwright is not installed: pip install playwright")
    with playwright.sync_playwright() as tools:
        found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
        if found is None and not Path(tools.chromium.executable_path).exists():
            missing("there is no browser here: apt-get install chromium, or playwright install chromium")
        launched = tools.chromium.launch(executable_path=found, args=list(FLAGS))
        try:
            yield launched
        finally:
            launched.close()


class Page:
    """A window of the studio, with everything that its console said and every address that it asked for."""

    def __init__(self, launched, address, size=(1280, 800), **context):
        self.context = launched.new_context(viewport={"width": size[0], "height": size[1]}, accept_downloads=True, **context)
        self.page = self.context.new_page()
        self.console, self.asked = [], []
        self.page.on("console", lambda message: self.console.append(f"{message.type}: {message.text}"))
        self.page.on("pageerror", lambda error: self.console.append(f"error: {error}"))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(address)
        self.until("Boolean(window.facesynth?.measured.ready)")

    @property
    def errors(self):
        """Of the console; what the driver of the graphics card remarks about speed is none."""
        return [line for line in self.console if line.startswith("error")]

    def see(self, expression):
        return self.page.evaluate(expression)

    def until(self, expression, within_s=120):
        """Wait until something is true in the page; the page forbids evaluation, so that it is asked from outside."""
        stop = time.monotonic() + within_s
        while not (found := self.page.evaluate(expression)):
            assert time.monotonic() < stop, (
                f"{expression} did not come true; {self.page.inner_text('#status')}; {self.console[-5:]}"
            )
            time.sleep(0.03)
        return found

    def until_settled(self):
        """Until everything that was asked for is shown."""
        self.until(
            "(() => { const s = facesynth.store; return s.motion && s.choices.length"
            " && s.shownRevision === s.project.revision && s.choicesRevision === s.project.revision; })()"
        )

    def load_a_line(self, utterance):
        """Of the corpus, by mouse."""
        self.page.click("#new-line")
        self.page.select_option("#new-line-utterance", utterance)
        self.after(lambda: self.page.click("#new-line-add"))
        self.until(f"facesynth.store.line === '{utterance}'")
        self.until_settled()

    def revision(self):
        return self.see("facesynth.store.project.revision")

    def take(self):
        return self.see(
            "facesynth.store.lines.get(facesynth.store.line).takes.find((take) => take.name === facesynth.store.take)"
        )

    def after(self, action):
        """Do something that changes the project, and wait until it did."""
        before = self.revision()
        action()
        self.until(f"facesynth.store.project.revision > {before}")

    def place(self, time_s, lane):
        """Where a moment is on a lane of the timeline, px on the page."""
        return self.see(f"facesynth.timeline.placeOf({time_s}, '{lane}')")

    def drag(self, start, end, steps=8):
        mouse = self.page.mouse
        mouse.move(*start)
        mouse.down()
        for step in range(1, steps + 1):
            mouse.move(*(a + (b - a) * step / steps for a, b in zip(start, end, strict=True)))
        mouse.up()
