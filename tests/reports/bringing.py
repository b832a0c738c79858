"""The command line on what people bring: a model whose mouth tells which phone it says, and corpora to add recordings to."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from click.testing import CliRunner

from facesynth.cli import cli
from facesynth.corpus import Corpus, Record
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.phones import PHONES
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.baselines.phone_mean import PhoneMean
from facesynth.speech.audio import save_wav

RATE, FPS = 16000, 50
CURVES = Layout("curves", ("jawOpen", "mouthClose", "mouthFunnel", "mouthPucker"))
OPEN = {"pau": 0.0, "p": 0.5, "b": 0.5, "m": 0.5, "aa": 0.9, "ae": 0.8, "ah": 0.7, "ow": 0.4, "iy": 0.3, "uw": 0.2}
"""jawOpen of phones whose opening tests look at; 0.25 of all others."""
ROUND = {"ow": 0.8, "uw": 1.0, "w": 1.0, "oy": 0.8, "uh": 0.7}


@dataclass(frozen=True)
class Voiced:
    """A file of clear speech."""

    path: Path
    text: str
    duration_s: float

    @classmethod
    def of(cls, path, text, audio, rate):
        save_wav(path, audio, rate)
        return cls(path, text, len(audio) / rate)


def run(*arguments):
    """`facesynth ARGUMENTS`: exit code, standard output, and everything that is said to a person, or the one line of an error."""
    result = CliRunner().invoke(cli, [str(argument) for argument in arguments])
    if isinstance(result.exception, FacesynthError):
        return 2, "", str(result.exception)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


def hum(seconds, loud=True):
    """[S] a sound that has something in it."""
    times = np.arange(round(seconds * RATE)) / RATE
    return (0.1 * loud * np.sin(2 * np.pi * 150 * times) * (1 + np.sin(2 * np.pi * 4 * times))).astype(np.float32)


def pose(phone):
    """[4] the curves of a phone."""
    shut = 0.5 if phone in ("p", "b", "m") else 0.0
    return np.array([OPEN.get(phone, 0.25), shut, ROUND.get(phone, 0.0), ROUND.get(phone, 0.0)], np.float32)


def talker(folder) -> Path:
    """A model of the phone mean whose curves at each phone are those of `pose`."""
    corpus = Corpus.create(folder / "talker", performer="T", layout=CURVES, fps=FPS, emotions=["neutral"], synthetic=True)
    for number in range(2):
        track = PhoneTrack(PHONES, np.arange(1, len(PHONES) + 1) * 0.2)
        frames = np.repeat([pose(phone) for phone in PHONES], round(0.2 * FPS), axis=0)
        speech = Speech(hum(track.duration_s), RATE, track, EmotionTrack.constant("neutral", track.duration_s), "all")
        corpus.add_utterance(Record(f"u{number}", "all", f"s{number}", "neutral"), speech, Motion(frames, FPS, CURVES))
    PhoneMean().fit(corpus).save(folder / "talker.safetensors")
    return folder / "talker.safetensors"


def spoken(model, sound, folder, *options):
    """Curves by name of a sound that the model says, at `FPS`, and the facts of --json; an error is an AssertionError."""
    out = folder / "out.npz"
    code, printed, said = run(
        "speak", model, sound, "-o", out, "--fps", FPS, "--head", "off", "--eyes", "off", "--json", *options
    )
    assert code == 0, said
    with np.load(out) as stored:
        names = [str(name) for name in stored["names"]]
        return dict(zip(names, stored["weights"].T, strict=True)), json.loads(printed)


def corpus_of(folder):
    """An empty corpus for recordings of `lay_down`."""
    layout = folder / "layout.yaml"
    layout.write_text(yaml.safe_dump(CURVES.to_dict()), encoding="utf-8")
    code, _, said = run("corpus", "new", folder / "corpus", "--performer", "A", "--layout", layout, "--fps", FPS)
    assert code == 0, said
    return folder / "corpus"


def lay_down(folder, name, seconds):
    """A sound and a motion file of one recording."""
    folder.mkdir(exist_ok=True)
    save_wav(folder / f"{name}.wav", hum(seconds), RATE)
    np.savez(folder / f"{name}.npz", frames=np.full((round(seconds * FPS), 4), 0.2, np.float32), fps=float(FPS))
    return folder / f"{name}.wav"


def added(corpus, *arguments):
    """The report of `corpus add` as JSON, and import.csv as text."""
    code, printed, said = run("corpus", "add", corpus, *arguments, "--jobs", 1, "--json")
    if code:
        return said, ""
    return json.loads(printed), (corpus / "import.csv").read_text(encoding="utf-8")


def checked(corpus):
    """What `corpus check` finds, as JSON."""
    return json.loads(run("corpus", "check", corpus, "--json")[1])["problems"]
