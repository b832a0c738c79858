"""The studio in a real browser with the network cut, by mouse and keyboard alone; what it exports is the command line's."""

import csv
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from browsing import Page, browser, started
from corpora import tiny_corpus

from facesynth.methods.efase.method import Efase

SIZE = "128x96"


@pytest.fixture(scope="module")
def shop(tmp_path_factory, rig):
    """A corpus and a model in a folder with a difficult name."""
    folder = tmp_path_factory.mktemp("Büro mit Ümläuten")
    corpus = tiny_corpus(folder / "actor", utterances=16, fps=60)
    Efase().fit(corpus).save(folder / "model.safetensors")
    return folder


def test_the_whole_way_by_mouse_and_keyboard(shop, tmp_path):
    project = tmp_path / "work"
    with started(shop / "actor", shop / "model.safetensors", "--project", project) as address, browser() as launched:
        page = Page(launched, address)
        load_a_line(page)
        move_a_boundary(page)
        half_angry(page)
        keep_and_remove_nodes(page)
        undo_and_redo(page)
        command, exported = export(page, project)
        assert page.errors == []
        assert all(asked.startswith(("http://127.0.0.1:", "blob:", "data:", "ws://127.0.0.1:")) for asked in page.asked)
    assert_command_line_makes_the_same(command, exported, tmp_path)


def load_a_line(page):
    page.page.click("#new-line")
    page.page.select_option("#new-line-utterance", "s00_neutral_t1")
    page.after(lambda: page.page.click("#new-line-add"))
    page.until_settled()


def move_a_boundary(page):
    """With the mouse, the face following; then back a step with the keyboard."""
    start_s, before_s = page.take()["phones"][2][1], page.take()["phones"][1][1]
    page.after(lambda: page.drag(page.place(start_s, "phones"), page.place(start_s + 0.02, "phones")))
    moved_s = page.take()["phones"][2][1]
    assert moved_s == pytest.approx(start_s + 0.02, abs=0.01)
    assert page.see("facesynth.measured.trials.length") > 0
    page.page.mouse.click(*page.place((before_s + start_s) / 2, "phones"))
    page.after(lambda: page.page.keyboard.press("Alt+ArrowLeft"))
    assert page.take()["phones"][2][1] == pytest.approx(moved_s - 0.005, abs=1e-6)


def half_angry(page):
    """With the keyboard: a region of its own, then its intensity."""
    page.page.click("#show-emotion")
    page.page.select_option("#paint-from", "0")
    page.page.select_option("#paint-to", "1")
    page.page.select_option("#paint-emotion", "angry")
    page.page.fill("#paint-intensity", "0.5")
    page.page.focus("#paint")
    page.after(lambda: page.page.keyboard.press("Enter"))
    assert ["angry", 0.5] in [[region[0], region[2]] for region in page.take()["emotions"]]
    page.until_settled()


def keep_and_remove_nodes(page):
    """One click keeps what the search chose."""
    page.page.mouse.click(*page.place(sum(row[1] for row in page.take()["phones"][2:4]) / 2, "phones"))
    page.page.click("#show-phone")
    page.until("Boolean(document.getElementById('pin-chosen'))")
    page.after(lambda: page.page.click("#pin-chosen"))
    assert len(page.take()["pins"]) == 1
    page.until_settled()


def undo_and_redo(page):
    page.page.focus("#timeline-canvas")
    page.after(lambda: page.page.keyboard.press("Control+z"))
    assert page.take()["pins"] == []
    page.after(lambda: page.page.keyboard.press("Control+Shift+Z"))
    assert len(page.take()["pins"]) == 1
    page.until_settled()


def export(page, project):
    page.page.click("#show-options")
    page.page.fill("#option-size", SIZE)
    page.after(lambda: page.page.keyboard.press("Tab"))
    page.page.click("#export")
    page.page.click("#export-start")
    page.until("[...facesynth.store.jobs.values()].some((job) => job.code !== null)", within_s=400)
    job = page.see("[...facesynth.store.jobs.values()][0]")
    assert job["code"] == 0, job
    names = page.page.eval_on_selector_all("#export-jobs a", "links => links.map((link) => link.download)")
    exported = []
    for name in names:
        with page.page.expect_download() as download:
            page.page.click(f'#export-jobs a[download="{name}"]')
        path = project / "exports" / name
        assert Path(download.value.path()).read_bytes() == path.read_bytes()
        exported.append(path)
    assert {path.suffix for path in exported} == {".mp4", ".csv"}
    page.page.keyboard.press("Escape")
    return job["command"], exported


def assert_command_line_makes_the_same(command, exported, folder):
    """The line that the studio shows, with other names of what it writes."""
    words = shlex.split(command)
    assert words[:2] == ["facesynth", "speak"]
    again = {str(path): str(folder / f"again{path.suffix}") for path in exported}
    subprocess.run([sys.executable, "-m", "facesynth", *(again.get(word, word) for word in words[1:])], check=True, timeout=600)
    for path in exported:
        assert path.read_bytes() == Path(again[str(path)]).read_bytes()
    with open(again[str(exported[0].with_suffix(".csv"))], newline="", encoding="utf-8") as file:
        assert len(list(csv.reader(file))) > 20
