"""The studio in a real browser with the network cut, by mouse and keyboard alone; what it exports is the command line's."""

import csv
import shlex
import shutil
import subprocess
import sys
import tarfile
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import torch
from browsing import Page
from sentences import ENDS_S
from serving import TOKEN, Served

from facesynth.atomic import write_text
from facesynth.cache import cache_dir
from facesynth.inference.motion import Motion
from facesynth.methods.capabilities import Capabilities, Option
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.studio.performing import Performing
from facesynth.studio.serve import head_file

AXE = "4.14.1"
SIZE = "128x96"


def test_the_whole_way_by_mouse_and_keyboard(shop, window, tmp_path):
    page = window()
    page.load_a_line("s00_neutral_t1")
    move_a_boundary(page)
    compare_takes(page)
    half_angry(page)
    constrain_from_the_map(page)
    remove_a_node(page)
    draw_a_node(page)
    undo_and_redo(page)
    command, exported = export(page, shop / "work")
    assert all(asked.startswith(("http://127.0.0.1:", "blob:", "data:", "ws://127.0.0.1:")) for asked in page.asked)
    assert_command_line_makes_the_same(command, exported, tmp_path)


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
    page.see("document.getElementById('show-emotion').click()")  # the panel is drawn anew whenever something arrives
    page.page.focus("#paint")
    page.after(lambda: page.page.keyboard.press("Enter"))
    assert ["angry", 0.5] in [[region[0], region[2]] for region in page.take()["emotions"]]
    page.until_settled()


def constrain_from_the_map(page):
    """With the mouse: hovering shows the pose, a click plays the node, a drag onto the timeline constrains it there."""
    phones = page.take()["phones"]
    middle_s = sum(row[1] for row in phones[2:4]) / 2
    page.page.mouse.click(*page.place(middle_s, "wave"))  # the playhead alone
    page.until(f"facesynth.map.state().map?.phone === '{phones[3][0]}' && facesynth.map.state().marks !== null")
    assert page.see("facesynth.store.phone") == 3
    filter_by_utterance(page)
    used = page.see("facesynth.store.choices[3].node")
    node = next(one for one in page.see("facesynth.map.state().map.nodes") if one != used)
    start = page.see(f"facesynth.map.placeOf('{node}')")
    page.page.mouse.move(*start)
    page.until("facesynth.store.picked !== null && facesynth.map.picks.took.length > 0")
    page.page.mouse.click(*start)
    page.until("facesynth.map.state().chosen !== null")
    node = page.see("facesynth.map.state().chosen")
    page.after(lambda: page.drag(start, page.place(middle_s, "nodes")))
    assert page.take()["pins"] == [[3, node]]
    page.until_settled()
    assert page.see("facesynth.store.choices[3].node") == node


def filter_by_utterance(page):
    """Of the map's nodes those of one recording are left."""
    utterance = page.see("facesynth.map.state().map.nodes[0].split(':')[0]")
    page.page.select_option("#map-utterance", utterance)
    shown = "facesynth.map.state().map.nodes.filter((_, k) => facesynth.map.state().map.shown[k])"
    page.until(f"{shown}.every((node) => node.startsWith('{utterance}:')) && {shown}.length > 0")
    page.page.select_option("#map-utterance", "")
    page.until(f"{shown}.length === facesynth.map.state().map.nodes.length && facesynth.map.state().marks !== null")


def compare_takes(page):
    """Of three takes each can be seen over the one that is shown."""
    for take in ("2", "3"):
        page.after(lambda: page.page.click("#new-take"))
        page.until(f"facesynth.store.take === '{take}'")
    page.until_settled()
    assert page.page.locator("#ghost option").all_inner_texts()[-2:] == ["take 1", "take 2"]
    page.page.select_option("#ghost", "take:1")
    page.until("facesynth.store.compared !== null && facesynth.face.pale !== undefined")
    page.page.select_option("#take", "1")
    page.until("facesynth.store.take === '1'")
    assert page.page.input_value("#ghost") == ""
    assert page.see("facesynth.store.compared") is None
    page.until_settled()


def remove_a_node(page):
    """With the keyboard on the map."""
    page.page.focus("#map-canvas")
    page.page.keyboard.press("ArrowRight")
    node = page.see("facesynth.map.state().chosen")
    page.after(lambda: page.page.keyboard.press("Delete"))
    assert node in page.see("facesynth.store.project.removed")
    page.until(f"!facesynth.map.state().map.nodes.includes('{node}')")
    page.until_settled()
    assert node not in [row["node"] for row in page.see("facesynth.store.choices")]


def draw_a_node(page):
    """A path over the map, seen on the face, named, kept, and used."""
    nodes = page.see("facesynth.map.state().map.nodes")
    page.page.focus("#map-canvas")
    page.page.keyboard.press("d")
    page.drag(*(page.see(f"facesynth.map.placeOf('{node}')") for node in (nodes[0], nodes[-1])))
    page.until("facesynth.store.picked !== null")
    page.page.fill("#draw-title", "wide")
    page.after(lambda: page.page.click("#draw-keep"))
    drawn = page.see("facesynth.store.project.drawn.at(-1)")
    assert drawn["title"] == "wide"
    page.until(f"facesynth.map.state().map.nodes.includes('{drawn['node']}')")
    page.page.click("#show-nodes")
    page.after(lambda: page.page.click(f'[aria-label="Use at phone 3: {drawn["node"]}"]'))
    page.until_settled()
    assert page.see("facesynth.store.choices[3].node") == drawn["node"]


def undo_and_redo(page):
    page.page.focus("#timeline-canvas")
    used = page.take()["pins"]
    page.after(lambda: page.page.keyboard.press("Control+z"))
    assert page.take()["pins"] != used
    page.after(lambda: page.page.keyboard.press("Control+Shift+Z"))
    assert page.take()["pins"] == used
    page.until_settled()


def export(page, project):
    page.page.click("#show-options")
    page.page.fill("#option-size", SIZE)
    page.after(lambda: page.page.keyboard.press("Tab"))
    page.page.click("#export")
    page.page.check('#export-kinds [value=".json"]')
    page.page.click("#export-start")
    exporting = "[...facesynth.store.jobs.values()].find((job) => job.title.startsWith('export'))"
    page.until(f"({exporting}?.code ?? null) !== null", within_s=400)
    job = page.see(exporting)
    assert job["code"] == 0, job
    names = page.page.eval_on_selector_all("#export-jobs a", "links => links.map((link) => link.download)")
    exported = []
    for name in names:
        with page.page.expect_download() as download:
            page.page.click(f'#export-jobs a[download="{name}"]')
        path = project / "exports" / name
        assert Path(download.value.path()).read_bytes() == path.read_bytes()
        exported.append(path)
    assert {path.suffix for path in exported} == {".mp4", ".csv", ".json"}
    page.page.keyboard.press("Escape")
    return job["command"], exported


def assert_command_line_makes_the_same(command, exported, folder):
    """The line that the studio shows, with other names of what it writes."""
    words = shlex.split(command)
    assert words[:2] == ["facesynth", "speak"]
    assert {"--phones", "--emotions", "--constraints", "--edits"} <= set(words)
    again = {str(path): str(folder / f"again{path.suffix}") for path in exported}
    subprocess.run([sys.executable, "-m", "facesynth", *(again.get(word, word) for word in words[1:])], check=True, timeout=600)
    for path in exported:
        assert path.read_bytes() == Path(again[str(path)]).read_bytes()
    with open(again[str(exported[0].with_suffix(".csv"))], newline="", encoding="utf-8") as file:
        assert len(list(csv.reader(file))) > 20


WOBBLE = Capabilities(
    "studio_wobble",
    "for this test",
    options=(Option("wobble", float, "How much it wobbles.", 0.0, 2.0), Option("backwards", bool, "Whether it plays backwards.")),
)


@register(WOBBLE)
class Wobble(Method):
    """A method that the studio has never heard of."""

    def fit(self, corpus, *, seed=0):
        self.learned_from(corpus)
        self.register_buffer("rest", torch.tensor(corpus.layout.neutral))
        return self.eval()

    def synthesize(self, speech, *, seed=0, wobble=0.0, backwards=False):
        count = int(speech.phones.frame_bounds(self.fps)[-1])
        jaw = wobble * np.sin(np.arange(count) / 5) ** 2
        frames = np.tile(self.rest.numpy(), (count, 1))
        frames[:, self.layout.columns("jaw")[1]] -= 12 * jaw
        return Motion(frames, self.fps, self.layout)


@pytest.fixture(scope="module")
def wobbling(chromium, tiny, tmp_path_factory, rig):
    """A page with a line of two phones in doubt, and a method that explains nothing."""
    folder = tmp_path_factory.mktemp("wobbling")
    performing = Performing.of(Wobble().fit(tiny))
    served = Served(folder / "served", tiny.path, performing, head_file(folder, performing).read_bytes())
    page = Page(chromium, f"http://{served.host}/?token={TOKEN}")
    page.until("facesynth.store.motion !== null")
    yield page
    page.context.close()
    served.close()
    assert page.errors == []


def test_a_method_that_states_its_options_shows_up_with_them(wobbling):
    page = wobbling
    still = page.see("Array.from(facesynth.store.motion.rows)")
    page.page.click("#show-options")
    assert "How much it wobbles" in page.page.inner_text("#inspector")
    assert page.page.is_visible("#option-backwards")
    page.page.fill("#option-wobble", "1.5")
    page.after(lambda: page.page.keyboard.press("Enter"))
    page.until("facesynth.store.shownRevision === facesynth.store.project.revision")
    assert page.see("Array.from(facesynth.store.motion.rows)") != still
    page.page.click("#show-phone")
    assert "does not tell what it chose" in page.page.inner_text("#inspector")
    assert page.page.is_disabled("#map-phone")


def test_phones_in_doubt_are_marked_until_somebody_vouches_for_them(wobbling):
    page = wobbling
    page.page.click("#show-table")
    marked = page.page.locator("#inspector .doubted").all_inner_texts()
    assert [text.strip() for text in marked] == ["? 40 % sure", "? 55 % sure"]
    assert "90 % sure" in page.page.inner_text("#inspector")
    in_time(lambda: [k for k in range(6) if dashes(page, k)], [2, 4])
    page.page.click("#show-phone")
    page.page.mouse.click(*page.place(sum(ENDS_S[1:3]) / 2, "phones"))
    in_time(lambda: page.page.inner_text("#phone-confidence"), "? 40 % sure")
    page.after(lambda: page.page.select_option("#phone-label", "aa"))
    in_time(page.page.locator("#phone-confidence").count, 0)
    in_time(lambda: [k for k in range(6) if dashes(page, k)], [4])


def in_time(look, wanted, within_s=60):
    """The canvas is painted when the browser finds the time."""
    stop = time.monotonic() + within_s
    while (found := look()) != wanted:
        assert time.monotonic() < stop, found
        time.sleep(0.03)


def dashes(page, phone):
    """How many points beneath a phone have the colour of doubt."""
    end_s, start_s = ENDS_S[phone], ENDS_S[phone - 1] if phone else 0.0
    (left, y), (right, _) = page.place(start_s, "phones"), page.place(end_s, "phones")
    return page.see(
        f"""(() => {{
          const canvas = document.getElementById("timeline-canvas"), box = canvas.getBoundingClientRect();
          const at = [{left} - box.left + 1, {y} - box.top + 8, {right - left} - 2, 5].map(Math.round);
          const points = canvas.getContext("2d").getImageData(...at).data;
          let count = 0;
          for (let k = 0; k < points.length; k += 4) count += points[k] > 240 && points[k + 1] > 190 && points[k + 2] < 130;
          return count;
        }})()"""
    )


def test_nothing_serious_for_people_who_cannot_see_or_use_a_mouse(window):
    """axe-core finds nothing serious on any page, and everything that a mouse does can be reached by Tab."""
    axe = axe_core()
    page = window(reduced_motion="reduce")
    page.load_a_line("s06_neutral_t1")
    page.until("document.getElementById('map-nodes').children.length > 0")  # of silence, too, the list says what the map shows
    for tab in ("phone", "emotion", "table", "nodes", "options"):
        page.page.click(f"#show-{tab}")
        assert serious(page, axe) == []
    for button in ("new-line", "export"):
        page.page.click(f"#{button}")
        assert serious(page, axe) == []
        page.page.keyboard.press("Escape")
    reached = tabbed_through(page)
    assert {
        "line",
        "undo",
        "play",
        "export",
        "face-canvas",
        "map-canvas",
        "timeline-canvas",
        "curve",
        "option-seed",
    } <= reached
    page.page.click("#tab-corpus")
    assert serious(page, axe) == []
    assert undecided(page) == []


def tabbed_through(page):
    """Ids of everything that Tab reaches from the top of the page."""
    page.page.evaluate("document.activeElement?.blur()")
    reached = []
    for _ in range(120):
        page.page.keyboard.press("Tab")
        reached.append(page.see("document.activeElement.id"))
    return set(reached)


def serious(page, axe):
    page.page.evaluate(axe)
    found = page.see("axe.run(document, { resultTypes: ['violations'] })")["violations"]
    return [(one["id"], one["nodes"][0]["target"]) for one in found if one["impact"] in ("serious", "critical")]


def undecided(page):
    """What contrast axe-core cannot tell; of texts of one letter it never tells."""
    found = page.see("axe.run(document, { runOnly: ['color-contrast'], resultTypes: ['incomplete'] })")["incomplete"]
    reasons = [(node["target"], node["any"][0]["data"]["messageKey"]) for one in found for node in one["nodes"]]
    return [(target, why) for target, why in reasons if why != "shortTextContent"]


def axe_core():
    """axe-core from npm, kept in the user's cache; a skip where it is not there and cannot be fetched."""
    kept = cache_dir("tests") / f"axe-core-{AXE}.js"
    if not kept.exists():
        npm = shutil.which("npm")
        if npm is None:
            pytest.skip("axe-core is fetched by npm, which is not installed")
        with TemporaryDirectory() as folder:
            done = subprocess.run([npm, "pack", f"axe-core@{AXE}"], cwd=folder, capture_output=True, timeout=120, check=False)
            if done.returncode:
                pytest.skip("axe-core cannot be fetched from npm")
            with tarfile.open(next(Path(folder).glob("*.tgz"))) as packed:
                write_text(kept, packed.extractfile("package/axe.min.js").read().decode())
    return kept.read_text(encoding="utf-8")
