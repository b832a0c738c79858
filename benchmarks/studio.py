"""How quickly the studio's page follows, measured in the browser.

    python benchmarks/studio.py CORPUS MODEL [--rounds 8]

From a change to the moving face: what is near the playhead, and the whole sentence; pictures a second while a boundary is
dragged; the timeline of ten minutes while it is scrolled; and how far the picture is from the sound after a minute.
Chromium runs without a screen and draws by the processor, on the same cores as the studio. Times of the clock tell what else
the machine does; times of the processor (Linux) do not: what studio and browser, drawing included, worked for a change.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from facesynth.corpus import Corpus
from facesynth.inference.speech import EmotionTrack, PhoneTrack
from facesynth.studio.document import first_take, take_facts
from facesynth.studio.project import Project

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studio"))
from browsing import Page, browser, started

PHONES = 30
TEN_MINUTES_S = 600.0
DRAG_S = 3.0


def add_line(project, name, audio, rate, phones, emotion):
    """A line in one emotion."""
    project.keep_sound(name, audio, rate)
    take = take_facts(first_take(phones, (), EmotionTrack.constant(emotion, phones.duration_s)))
    project.change("add_line", {"name": name, "text": "", "take": take, "utterance": ""})


def prepare(folder, corpus):
    """A project with a sentence of about thirty phones and a line of ten minutes."""
    utterances = [corpus[name] for name in corpus.ids[:60]]
    sentence = min(utterances, key=lambda one: abs(len(one.speech.phones) - PHONES)).speech
    project = Project.open(folder)
    add_line(project, "sentence", sentence.audio, sentence.sample_rate, sentence.phones, corpus.emotions[0])
    times = int(np.ceil(TEN_MINUTES_S / sentence.phones.duration_s))
    ends_s = np.concatenate([sentence.phones.ends_s + k * sentence.phones.duration_s for k in range(times)])
    sound = sentence.audio[: round(sentence.phones.duration_s * sentence.sample_rate)]
    long = PhoneTrack(sentence.phones.labels * times, ends_s)
    add_line(project, "ten-minutes", np.tile(sound, times), sentence.sample_rate, long, corpus.emotions[0])
    project.close()
    return len(sentence.phones), len(long)


def worked_ms():
    """Milliseconds of the processor that the studio and the browser worked so far: all descendants of this process."""
    parents, spent = {}, {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, fields = path.read_text().split("(", 1)[1].rsplit(")", 1)
        except (OSError, IndexError):
            continue
        numbers = fields.split()
        parents[int(path.parent.name)] = int(numbers[1])
        spent[int(path.parent.name)] = name, 1000 * (int(numbers[11]) + int(numbers[12])) / os.sysconf("SC_CLK_TCK")
    total = {"studio": 0.0, "browser": 0.0}
    for process, (name, milliseconds) in spent.items():
        above = process
        while above in parents and above != os.getpid():
            above = parents[above]
        if above == os.getpid() and process != above and name != "node":
            total["browser" if "chrom" in name else "studio"] += milliseconds
    return np.array([total["studio"], total["browser"]])


def changed(page, do, facts):
    """Milliseconds from a change to the face near the playhead, and to the whole of it; of the processor, studio and browser."""
    page.until_settled()
    before = worked_ms()
    page.see(f"facesynth.timed({json.dumps(do)}, {json.dumps(facts)})")
    page.until("facesynth.measured.timed !== null && facesynth.measured.timed.whole !== undefined")
    timed = page.see("facesynth.measured.timed")
    return (timed["first"], timed["whole"], *(worked_ms() - before))


def changes(page, rounds):
    """Of each kind of change, its milliseconds."""
    take = page.take()
    phone = next(k for k in range(len(take["phones"]) // 2, len(take["phones"])) if take["phones"][k][0] != "pau")
    start_s, end_s = take["phones"][phone - 1][1], take["phones"][phone][1]
    page.see(f"facesynth.sound.seek({(start_s + end_s) / 2})")
    emotions = page.see("facesynth.store.model.emotions")
    nodes = [row["node"] for row in page.see(f"facesynth.next({phone})")]
    rng = np.random.default_rng(0)
    found = {"boundary": [], "constraint": [], "intensity": [], "emotion": []}
    for k in range(rounds):
        to_s = round(end_s + rng.uniform(-0.012, 0.012), 4)
        found["boundary"].append(changed(page, "move_boundary", {"phone": phone, "end_s": to_s}))
        found["constraint"].append(changed(page, "pin", {"phone": phone, "node": nodes[k % len(nodes)]}))
        intensity = round(0.2 + 0.6 * k / rounds, 3)
        felt = emotions[1 % len(emotions)]
        found["intensity"].append(changed(page, "set_emotion", {"region": 0, "emotion": felt, "intensity": intensity}))
        felt = emotions[k % len(emotions)]
        found["emotion"].append(changed(page, "set_emotion", {"region": 0, "emotion": felt, "intensity": 1}))
    return found, (phone, end_s)


def dragged(page, boundary_s):
    """Pictures of the face and of the timeline a second while a boundary is dragged, and milliseconds from drag to face."""
    page.until_settled()
    page.see("facesynth.measured.trials.length = 0")
    mouse, (x, y) = page.page.mouse, page.place(boundary_s, "phones")
    mouse.move(x, y)
    mouse.down()
    worked, begun, before = worked_ms(), time.perf_counter(), page.see("[facesynth.face.drawn, facesynth.timeline.counted.drawn]")
    step = 0
    while (now := time.perf_counter() - begun) < DRAG_S:
        step += 1
        mouse.move(x + 6 * np.sin(7 * now), y)
    after = page.see("[facesynth.face.drawn, facesynth.timeline.counted.drawn]")
    seconds, worked = time.perf_counter() - begun, worked_ms() - worked
    mouse.up()
    trials = page.see("facesynth.measured.trials")
    faces, lines = (b - a for a, b in zip(before, after, strict=True))
    return (faces / seconds, lines / seconds), trials, (worked[0] / max(len(trials), 1), worked[1] / max(faces, 1))


def scrolled(page):
    """Milliseconds that drawing the timeline of ten minutes takes while it is zoomed and scrolled."""
    page.page.select_option("#line", "ten-minutes")
    page.until("facesynth.store.motion !== null", within_s=600)
    page.until("facesynth.sound.peaks.of?.includes('ten-minutes')")
    x, y = page.place(300, "wave")
    page.page.mouse.move(x, y)
    page.see("facesynth.timeline.counted.took.length = 0")
    for k in range(120):
        if k % 10 == 0:
            page.page.keyboard.down("Control")
        page.page.mouse.wheel(0, -150 if k < 60 else 200)
        if k % 10 == 9:
            page.page.keyboard.up("Control")
    page.page.keyboard.up("Control")
    return page.see("facesynth.timeline.counted.took")


def drift(page, seconds):
    """Largest distance between what is heard and what is shown, s, over a while."""
    page.page.click("#play")
    page.see("facesynth.sound.apart.length = 0")
    time.sleep(seconds)
    page.page.click("#play")
    return max(page.see("facesynth.sound.apart.map(Math.abs)"))


def row(name, values):
    values = np.array(values)
    return f"| {name} | {np.median(values):.0f} | {np.quantile(values, 0.9):.0f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("corpus", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--play", type=float, default=60.0, help="Seconds of playing.")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        phones, long = prepare(Path(folder), Corpus.open(asked.corpus))
        with started(asked.corpus, asked.model, "--project", folder) as address, browser() as launched:
            page = Page(launched, address)
            page.page.select_option("#line", "sentence")
            page.until_settled()
            found, (_, boundary_s) = changes(page, asked.rounds)
            (faces, lines), trials, (each_trial, each_face) = dragged(
                page, page.take()["phones"][len(page.take()["phones"]) // 2][1] or boundary_s
            )
            took = scrolled(page)
            apart_s = drift(page, asked.play)
    print(f"sentence of {phones} phones, line of ten minutes of {long} phones\n")
    print("| change, ms of the processor, mean | studio | browser |\n|---|---|---|")
    for name, times in found.items():
        studio, chromium = np.mean([one[2:] for one in times], axis=0)
        print(f"| {name} | {studio:.0f} | {chromium:.0f} |")
    print(f"| each face while dragging | {each_trial:.0f} | {each_face:.0f} |\n")
    print("| ms of the clock | median | 9 of 10 |\n|---|---|---|")
    for name, times in found.items():
        print(row(f"{name} → face near the playhead", [one[0] for one in times]))
        print(row(f"{name} → whole sentence", [one[1] for one in times]))
    print(row("boundary being dragged → face", trials))
    print(row("one picture of the timeline of ten minutes", took))
    print(f"\nwhile dragging: {faces:.0f} pictures of the face and {lines:.0f} of the timeline a second")
    print(f"after {asked.play:g} s of playing the picture was at most {1000 * apart_s:.1f} ms from the sound")


if __name__ == "__main__":
    main()
