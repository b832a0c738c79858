"""`facesynth emotion`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from facesynth.cli.options import as_json, show
from facesynth.cli.types import FILE
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from facesynth.corpus.workers import Workers
    from facesynth.methods.emotion.detector import EmotionDetector


@click.command("emotion")
@click.argument("model", type=FILE)
@click.argument("speech", nargs=-1, required=True, type=FILE)
@click.option("--windows", is_flag=True, help="Follow the emotion over time.")
@click.option("--window-s", type=click.FloatRange(min=0.2), default=2.0, show_default=True, help="Length of a window.")
@click.option("--hop-s", type=click.FloatRange(min=0.05), default=0.5, show_default=True, help="Step between windows.")
@click.option("--speaker", multiple=True, type=FILE, help="More of the same speaker (files, folders), for one that normalises.")
@click.option("-o", "--output", type=FILE, help="Write an emotion track for `speak --emotions` (CSV).")
@as_json
def emotion(
    *,
    model: Path,
    speech: tuple[Path, ...],
    windows: bool,
    window_s: float,
    hop_s: float,
    speaker: tuple[Path, ...],
    output: Path | None,
    as_json: bool,
) -> None:
    """Hear the emotion in SPEECH, files or folders of them, with the detector MODEL.

    The emotion named is the one that wins most of the pairwise decisions; the most probable one may be another.
    With --windows it is the most probable one of the windows that cover each moment.
    """
    from facesynth.cli.recordings import recordings
    from facesynth.methods.emotion.detector import EmotionDetector

    detector = EmotionDetector.load(model)
    paths = recordings(speech)
    if output and len(paths) > 1:
        raise FacesynthError("-o takes the emotion track of one recording; give one")
    own = _features(detector, recordings(speaker)) if speaker else None
    span = (window_s, hop_s) if windows else None
    results = [_read(detector, path, own, span, output) for path in paths]
    show(as_json, results if len(results) > 1 else results[0], [line for result in results for line in _lines(result)])


def _features(detector: EmotionDetector, paths: list[Path]) -> NDArray[np.float64]:
    from facesynth.methods.emotion.detector import Clip
    from facesynth.speech.audio import load_audio

    return detector.features_of([Clip(*load_audio(path), emotion="") for path in paths])


def _read(
    detector: EmotionDetector,
    path: Path,
    own: NDArray[np.float64] | None,
    span: tuple[float, float] | None,
    output: Path | None,
) -> dict[str, Any]:
    from facesynth.inference.emotion_track import track_of
    from facesynth.inference.speech import EmotionTrack
    from facesynth.speech.audio import read_sound, require_sound
    from facesynth.speech.emotions import write_emotions

    sound = read_sound(path)
    audio, rate = sound.audio, sound.sample_rate
    require_sound(audio, rate)
    for remark in sound.remarks:
        click.echo(f"warning: {path.name}: {remark}", err=True)
    facts: dict[str, Any] = {"speech": str(path), "duration_s": len(audio) / rate, "remarks": sound.remarks}
    if span is None:
        reading = detector.detect(audio, rate, own)
        track = EmotionTrack.constant(reading.emotion, len(audio) / rate)
        facts |= {"emotion": reading.emotion, "probabilities": reading.probabilities}
    else:
        ends_s, probabilities = detector.along(audio, rate, window_s=span[0], hop_s=span[1], speaker=own)
        track = track_of(ends_s, probabilities, detector.emotions)
        facts["windows"] = [
            {"end_s": end, "probabilities": dict(zip(detector.emotions, row, strict=True))}
            for end, row in zip(ends_s.tolist(), probabilities.tolist(), strict=True)
        ]
    facts["track"] = [{"end_s": e, "emotion": label} for label, e in zip(track.labels, track.ends_s.tolist(), strict=True)]
    if output:
        write_emotions(output, track)
    return facts


def _lines(facts: dict[str, Any]) -> list[str]:
    if "emotion" in facts:
        likely = sorted(facts["probabilities"].items(), key=lambda item: -item[1])
        return [f"{facts['speech']}: {facts['emotion']} ({', '.join(f'{name} {p:.2f}' for name, p in likely)})"]
    starts_s = [0.0, *(row["end_s"] for row in facts["track"])]
    spans = zip(starts_s, facts["track"], strict=False)
    return [f"{facts['speech']}:", *(f"  {start:7.2f} to {row['end_s']:7.2f} s  {row['emotion']}" for start, row in spans)]


def train_detector(
    source: Path, config: Mapping[str, Any], output: Path, split_seed: int | None, *, workers: Workers, as_json: bool
) -> None:
    """`facesynth train emotion`: learn from a corpus, or from a list of sound files, and write a detector.

    split_seed: learn from the training sentences of that split of a corpus; None: from everything. workers: who extracts
    the features of the voices.
    """
    from facesynth.corpus import Corpus
    from facesynth.methods.emotion.clips import clips_of_corpus, clips_of_list
    from facesynth.methods.emotion.detector import DetectorSettings, EmotionDetector

    detector = EmotionDetector(DetectorSettings.from_config(config))
    if source.is_dir():
        corpus = Corpus.open(source)
        corpus = corpus if split_seed is None else corpus.split(split_seed)[0]
        clips, detector.provenance = clips_of_corpus(corpus), corpus.provenance()
    else:
        clips = clips_of_list(source)
        unknown = {"licences": ["unknown"], "consents": ["unknown"]}
        detector.provenance = {"recordings": source.name, "clips": len(clips), **unknown}
        click.echo(f"warning: {source} states no licences or consents; the detector says that they are unknown", err=True)
    detector.fit(clips, workers).save(output)
    facts = {"model": str(output), "method": "emotion", "recordings": len(clips), "emotions": list(detector.emotions)}
    use = f"listen with `facesynth emotion {output} speech.wav`, or put it beside a model for `--emotion auto`"
    learned = f"emotion learned {', '.join(detector.emotions)} from {len(clips)} recordings"
    show(as_json, facts, [learned, f"{output}: {use}"])
