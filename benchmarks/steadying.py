"""Which filter takes the trembling out of tracked lips and keeps them shut: zero-phase low-pass against One Euro.

    python benchmarks/steadying.py CLIPS CORPUS

CLIPS: videos; CORPUS: the corpus that was made of them, for its rest pose and its phones. One Euro is the filter of
Casiez, Roussel, Vogel 2012, as one would run it on a live camera: it looks at the past only, so it is late.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from facesynth.capture.kept_tracks import kept_track
from facesynth.capture.landmarks import LIP_PAIRS, RIGID
from facesynth.capture.motion import steadied
from facesynth.capture.shape import in_mm
from facesynth.capture.track import Track
from facesynth.corpus import Corpus
from facesynth.corpus.add.recordings import VIDEO
from facesynth.motion.pose import remove_head
from facesynth.speech.textgrid import read_textgrid

CLIPS = 36
CLOSED, OPEN = ("p", "b", "m"), ("aa", "ae", "ah", "ao", "aw", "ay", "ey", "ow")
Filter = Callable[[np.ndarray, float], np.ndarray]


def one_euro(lowest_hz: float, per_px_s: float) -> Filter:
    def filtered(points: np.ndarray, fps: float) -> np.ndarray:
        result = np.array(points, float)
        last, speed = None, np.zeros_like(result[0])
        for row in result:
            if np.isnan(row).any():
                last = None
                continue
            if last is not None:
                speed += _share(1.0, fps) * ((row - last) * fps - speed)
                row[:] = last + _share(lowest_hz + per_px_s * np.abs(speed), fps) * (row - last)
            last = row.copy()
        return result

    return filtered


def _share(cutoff_hz, fps):
    return 1 / (1 + fps / (2 * np.pi * cutoff_hz))


def lip_gaps(track: Track, rest: np.ndarray, smooth: Filter) -> np.ndarray:
    steady = Track(smooth(track.points_px, track.fps).astype(np.float32), track.irises_px, track.fps)
    points, _ = remove_head(in_mm(steady, rest), rest, RIGID)
    return np.mean([points[:, upper, 1] - points[:, lower, 1] for upper, lower in LIP_PAIRS], axis=0)


def delay_ms(gap: np.ndarray, raw: np.ndarray, fps: float) -> float:
    known = np.isfinite(gap) & np.isfinite(raw)
    fine = np.arange(0, known.sum() - 1, 0.1)
    a, b = (np.interp(fine, np.arange(known.sum()), np.gradient(x[known])) for x in (gap, raw))
    lags = range(-20, 21)
    match = [np.corrcoef(a[max(k, 0) : len(a) + min(k, 0)], b[max(-k, 0) : len(b) - max(k, 0)])[0, 1] for k in lags]
    return 100 * lags[int(np.argmax(match))] / fps


def study(name: str, smooth: Filter, clips: list[tuple[Track, np.ndarray, tuple[str, ...], np.ndarray]]) -> None:
    shut, wide, late = [], [], []
    for track, rest, labels, bounds in clips:
        gap, raw = lip_gaps(track, rest, smooth), lip_gaps(track, rest, lambda points, fps: points)
        late.append(delay_ms(gap, raw, track.fps))
        for label, start, stop in zip(labels, bounds[:-1], bounds[1:], strict=True):
            piece = gap[max(start - 1, 0) : max(stop, start + 1) + 1]
            if len(piece) and np.isfinite(piece).any():
                shut += [np.nanmin(piece)] if label in CLOSED else []
                wide += [np.nanmax(piece)] if label in OPEN else []
    print(f"{name:24s} {np.mean(shut):.2f} {np.percentile(shut, 90):.2f} {np.mean(wide):.2f} {np.median(late):+.0f} ms")


def main(folder: Path, corpus: Corpus) -> None:
    videos = [path for path in sorted(folder.iterdir()) if path.suffix.lower() in VIDEO and path.stem in corpus]
    videos = videos[:: max(len(videos) // CLIPS, 1)][:CLIPS]
    rest = np.reshape(np.array(corpus.layout.neutral), (-1, 3))
    clips = []
    for path in videos:
        phones, _ = read_textgrid(corpus.files.phones(path.stem))
        clips.append((kept_track(path), rest, phones.labels, phones.frame_bounds(corpus.fps)))
    print("filter; gap at p, b, m: mean, 90th percentile; largest gap in vowels: mean; median delay")
    study("none", lambda points, fps: points, clips)
    for cutoff_hz in (4, 6, 8, 10):
        study(f"zero-phase {cutoff_hz} Hz", lambda points, fps, c=cutoff_hz: steadied(points, fps, c), clips)
    for lowest_hz, per_px_s in ((1, 0.02), (2, 0.05), (4, 0.1), (4, 0.3)):
        study(f"One Euro {lowest_hz} Hz, {per_px_s}", one_euro(lowest_hz, per_px_s), clips)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Corpus.open(sys.argv[2]))
