"""`facesynth demo`: everything with nothing recorded."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.options import as_json, seeded, show
from facesynth.cli.types import FOLDER, Size

if TYPE_CHECKING:
    from facesynth.corpus import Corpus
    from facesynth.face.rig.arkit_rig import Rig
    from facesynth.inference.speech import Speech
    from facesynth.methods.method import Method
    from facesynth.speech.segments import Segment
    from facesynth.stage.performance import HeadStage, Performance


class Clock:
    """Prints how long each step took."""

    def __init__(self) -> None:
        self.start = self.last = time.perf_counter()
        self.seconds: dict[str, float] = {}

    def step(self, name: str, line: str) -> None:
        """The step `name` is done; print `line` and its seconds."""
        now = time.perf_counter()
        self.seconds[name] = now - self.last
        click.echo(f"[{now - self.start:6.1f} s] {line} ({now - self.last:.1f} s)", err=True)
        self.last = now

    @property
    def total_s(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self.start


@click.command("demo")
@click.option("-o", "--output", type=FOLDER, default=Path("facesynth-demo"), show_default=True)
@seeded
@click.option("--size", type=Size(), show_default="1280x720", help="Of the video.")
@as_json
def demo(output: Path, seed: int, size: tuple[int, int] | None, as_json: bool) -> None:
    """Let the model that speaks for anybody say a sentence; then build the synthetic performer, train a method on it and let
    that say it through three emotions.

    The performer and the model are kept in the user's cache, so that a second run only speaks.
    """
    from facesynth.performer.build import build_performer
    from facesynth.stage.cast import Cast
    from facesynth.stage.performance import HeadStage
    from facesynth.stage.request import Request

    request = Request(seed=seed, size=size)
    clock = Clock()
    speech, _ = demo_speech(seed)
    clock.step("speech", f"{speech.duration_s:.1f} s of new speech: {', '.join(speech.emotions.labels)}")
    stage = HeadStage.of(request)
    first = _said_by_default(output, speech, stage)
    clock.step("first", f"{first}: {first.stem}, which comes with facesynth; `facesynth models` lists it and others")
    corpus = build_performer("small", seed=seed)
    clock.step("corpus", f"synthetic performer {corpus.performer}: {len(corpus)} utterances")
    model, fresh = trained_model(corpus, seed)
    clock.step("train", f"{model.name}: {model.capabilities.summary}")
    performance = stage.perform(model.synthesize(speech, seed=seed), speech, Cast(model))
    clock.step("motion", f"{len(performance.motion)} frames of motion at {performance.motion.fps:g} fps, on the head")
    made = [output / f"demo{suffix}" for suffix in (".csv", ".glb", ".npz", ".mp4")]
    for path in made:
        performance.write(path)
        clock.step(path.suffix, f"{path}: {path.stat().st_size / 1e6:.1f} MB")
    made.append(_strip(output / "demo.png", performance, stage.rig))
    clock.step(".png", f"{made[-1]}: one picture of each emotion")
    _report(clock, [first, *made], fresh, corpus.path, as_json)


def _said_by_default(output: Path, speech: Speech, stage: HeadStage) -> Path:
    """A video of the model of those who name none, of the first sentence: a face before anything is learned."""
    from facesynth.stage.cast import Cast
    from facesynth.zoo.shelf import DEFAULT, load

    model, path = load(), output / f"{DEFAULT}.mp4"
    plain = _first_sentence(speech, model.emotions[0])
    stage.perform(model.synthesize(plain), plain, Cast(model)).write(path)
    return path


def _first_sentence(speech: Speech, emotion: str) -> Speech:
    """What is said in the first emotion of the track, in the one that is given."""
    import numpy as np

    from facesynth.inference.speech import EmotionTrack, PhoneTrack

    stop_s, ends_s = float(speech.emotions.ends_s[0]), speech.phones.ends_s
    count = int(np.searchsorted(ends_s, stop_s)) + 1
    phones = PhoneTrack(speech.phones.labels[:count], np.minimum(ends_s[:count], stop_s))
    audio = speech.audio[: round(stop_s * speech.sample_rate)]
    return replace(speech, audio=audio, phones=phones, emotions=EmotionTrack.constant(emotion, stop_s))


def _strip(path: Path, performance: Performance, rig: Rig) -> Path:
    """The face in the middle of each emotion, side by side, where the mouth is widest open around it."""
    import numpy as np
    from PIL import Image

    from facesynth.atomic import atomic_path
    from facesynth.face.draw.render import Renderer

    animation, track = performance.animation, performance.speech.emotions
    renderer = Renderer.of(rig, (480, 540))
    starts = np.concatenate([[0.0], track.ends_s[:-1]])
    pictures = []
    for start, end in zip(starts, track.ends_s, strict=True):
        inner = slice(int((0.35 * end + 0.65 * start) * animation.fps), int((0.75 * end + 0.25 * start) * animation.fps))
        k = inner.start + int(animation.weight("jawOpen")[inner].argmax())
        pictures.append(renderer.render(rig.vertices(animation, k)))
    with atomic_path(path) as part:
        Image.fromarray(np.hstack(pictures)).save(part, format="PNG")
    return path


def trained_model(corpus: Corpus, seed: int) -> tuple[Method, bool]:
    """The model for this corpus, from the cache or made now, and whether it was made now."""
    from facesynth import __version__
    from facesynth.cache import cache_dir
    from facesynth.methods.model_file import FORMAT
    from facesynth.methods.registry import DEFAULT, create, load
    from facesynth.methods.training import train

    model = create(DEFAULT)
    made_of = json.dumps([__version__, FORMAT, model.config, corpus.provenance()["sha256"], seed])
    path = cache_dir("models") / f"demo-{DEFAULT}-{sha256(made_of.encode()).hexdigest()[:16]}.safetensors"
    if path.exists():
        return load(path), False
    model = train(type(model), corpus, model.config, seed=seed)
    model.save(path)
    model.path = path
    return model, True


def demo_speech(seed: int) -> tuple[Speech, tuple[Segment, ...]]:
    """What the demo says, and its words, from the cache or said now; what is read back is what was written, in both cases."""
    import numpy as np

    from facesynth import __version__
    from facesynth.cache import cache_dir
    from facesynth.inference.npz import read_arrays
    from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
    from facesynth.performer.lines import DEMO_LINES

    made_of = json.dumps([__version__, DEMO_LINES, seed, "with words"])
    path = cache_dir("models") / f"demo-speech-{sha256(made_of.encode()).hexdigest()[:16]}.npz"
    if not path.exists():
        _keep_speech(path, seed)
    names = ("audio", "rate", "phones", "phone_ends_s", "emotions", "emotion_ends_s", "words", "word_times_s")
    kept = read_arrays(path, "the demo's speech", names)
    phones = PhoneTrack(tuple(kept["phones"].tolist()), kept["phone_ends_s"])
    emotions = EmotionTrack(tuple(kept["emotions"].tolist()), kept["emotion_ends_s"], np.ones(len(kept["emotions"])))
    timed = zip(kept["words"].tolist(), kept["word_times_s"].tolist(), strict=True)
    words = tuple((word, start_s, end_s) for word, (start_s, end_s) in timed)
    return Speech(kept["audio"], int(kept["rate"]), phones, emotions, " ".join(text for text, _ in DEMO_LINES)), words


def _keep_speech(path: Path, seed: int) -> None:
    import numpy as np

    from facesynth.atomic import atomic_path
    from facesynth.performer.lines import DEMO_LINES, speak_lines
    from facesynth.speech.alignment import align

    lines = speak_lines(DEMO_LINES, seed=seed)
    found = align(lines.audio, lines.rate, lines.text)
    phones = found.phones
    ends_s = [*lines.emotions.ends_s[:-1], phones.duration_s]
    arrays = {
        "audio": lines.audio,
        "rate": np.array(lines.rate),
        "phones": np.array(phones.labels),
        "phone_ends_s": phones.ends_s,
        "emotions": np.array(lines.emotions.labels),
        "emotion_ends_s": np.array(ends_s),
        "words": np.array([word for word, _, _ in found.words]),
        "word_times_s": np.array([times_s for _, *times_s in found.words]),
    }
    with atomic_path(path) as part:
        np.savez(part, allow_pickle=False, **arrays)


def _report(clock: Clock, written: list[Path], fresh: bool, corpus: Path, as_json: bool) -> None:
    """Both times: of this run, and of the run that had to build everything."""
    from facesynth.atomic import write_text
    from facesynth.cache import cache_dir

    kept = cache_dir("models") / "demo-seconds.json"
    if fresh:
        write_text(kept, json.dumps({"first_run_s": clock.total_s}))
    first = json.loads(kept.read_text(encoding="utf-8"))["first_run_s"] if kept.exists() else None
    facts: dict[str, Any] = {"seconds": clock.total_s, "first_run_s": first, "steps_s": clock.seconds}
    facts |= {"written": [str(path) for path in written], "corpus": str(corpus), "synthetic": True}
    again = "" if fresh or first is None else f"; the first run, which built everything, took {first:.1f} s"
    done = f"done in {clock.total_s:.1f} s{again}"
    show(as_json, facts, [done, f"watch {written[-2]}; the synthetic performer's recordings are in {corpus}"])
