"""Sound and phones in, motion out: at once, or as they come in."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..checks import checked_rate
from ..closures import close_at
from ..errors import FacesynthError, reject_options, unknown
from ..expectation import Bands, Expectation, Said
from ..filters import sharpen
from ..last_search import LastSearch
from ..layout import Layout
from ..lips import bilabial_spans
from ..long_arrays import by_blocks
from ..motion import Motion
from ..phones import PHONE_INDEX, PHONES
from ..speech import Speech
from .assembly import Blender, blend, mean_motion
from .candidates import Chooser
from .emotions import EmotionMapper
from .graph import Graph
from .hearing import RATE, Ear, ranges, require_sound
from .lowpass import LowPass
from .plan import Plan, Wish, explain, make_plan, shares_of_others
from .search import NUMPY, PathSearch, Weights
from .stream import AnimeStream, WishStream

GUARD_S = 0.25
"""The low-pass filter of `open_stream` sees this much of what follows a frame …"""
REMEMBERED_S = 1.0
"""… and this much of what lies before it."""
OPTIONS = ("seed", "look_ahead", "to_emotion", "to_intensity")


@dataclass(frozen=True, eq=False, repr=False)
class AnimeGraph:
    """Everything that a trained graph speaks with; its parts are graphs of an exported folder, or modules of torch."""

    layout: Layout
    fps: float
    emotions: tuple[str, ...]
    chooser: Chooser
    weights: Weights
    metric: Floats
    """[D, D] distance of two frames is that of their components times this."""
    low_pass: LowPass
    mapper: EmotionMapper
    decode: Callable[[Floats], Floats]
    """Components [T, D] to frames [T, C]."""
    hear: Callable[[Speech], Floats]
    """Speech to audio features [G, P]."""
    feature_fps: float
    """Hz, of these."""
    closed_gap: float
    """How near the lips come at a p, b or m; infinite where the recordings do not show it."""
    utterances: tuple[str, ...]
    """Names of the recordings that nodes are of."""
    bands: Bands | None = None
    expectation: Expectation | None = None
    """What sound and phones lead one to expect, of components times metric; with `bands`."""
    ear: Callable[[], Ear] | None = None
    """Something that hears a sound from its start, for streams of sound."""
    temperature: float = 0.0
    sharpening: float = 0.0
    help_pairs: bool = True
    search: PathSearch = NUMPY
    last: LastSearch[dict[str, Any]] = field(default_factory=LastSearch)
    """The summary of the plan of the last speech that was said."""
    manifest: Mapping[str, Any] = field(default_factory=dict)
    """Of the folder that it comes from."""

    @property
    def graph(self) -> Graph:
        """The recorded nodes."""
        return self.chooser.graph

    def synthesize(
        self,
        speech: Speech,
        *,
        seed: int = 0,
        look_ahead: int | None = None,
        to_emotion: str | None = None,
        to_intensity: float = 1.0,
        **options: Any,
    ) -> Motion:
        """Motion for new speech. Nothing is random: `seed` changes nothing.

        One after the other: the path, or above temperature 0 each phone as the mean of its candidates, brought to time;
        `low_pass` at the learned cut-offs; `sharpen`; components decoded; lips closed at p, b, m (`close_at`).

        look_ahead: search that many phones ahead, as for streaming, in place of the whole utterance.
        to_emotion, to_intensity: find motion in the speech's own emotion and map it to this one.
        """
        reject_options("anime_graph", options, OPTIONS)
        plan = self.plan(speech, look_ahead=look_ahead)
        self.last.keep(speech, (look_ahead,), plan.summary())
        return self.moved(speech, plan, to_emotion=to_emotion, to_intensity=to_intensity)

    def moved(self, speech: Speech, plan: Plan, *, to_emotion: str | None = None, to_intensity: float = 1.0) -> Motion:
        """The motion of the speech that was planned; the rest as in `synthesize`."""
        smooth = self.low_pass(self.joined(plan))
        frames = by_blocks(self.decode, sharpen(smooth, self.sharpening, self.fps), np.float64)
        frames = close_at(frames, self.layout, bilabial_spans(speech.phones, self.fps), self.closed_gap, self.fps)
        motion = self.mapper.with_intensity(Motion(by_blocks(np.asarray, frames), self.fps, self.layout), speech)
        return motion if to_emotion is None else self.mapper.map_along(motion, speech, to_emotion, intensity=to_intensity)

    def joined(self, plan: Plan) -> Floats:
        """[frames, D] the phones one after the other, not yet smoothed."""
        if self.temperature > 0:
            return mean_motion(self.chooser, plan, self.search.soft_path(plan.steps, self.weights, self.temperature))
        return blend(self.chooser, plan, Blender(self.chooser, self.fps, help_pairs=self.help_pairs))

    def plan(self, speech: Speech, *, look_ahead: int | None = None) -> Plan:
        """The path through the graph that expresses speech."""
        return make_plan(self.chooser, self.wishes(speech), self.metric, self.weights, look_ahead, self.search)

    def wishes(self, speech: Speech) -> list[Wish]:
        """What each phone of the speech asks for."""
        phones = speech.phones.told("anime_graph")
        feelings, _ = speech.emotions.per_phone(phones)
        each = [self.numbers(label, feeling) for label, feeling in zip(phones.labels, feelings, strict=True)]
        said, felt = np.array(each).T
        require_sound(speech.audio, "the speech")
        features = self.hear(speech)
        heard = ranges(speech.phones, self.feature_fps, len(features)).tolist()
        bounds = speech.phones.frame_bounds(self.fps)
        poses: list[Floats | None] = [None] * len(said)
        if self.expectation is not None and self.bands is not None:
            told = Said.numbered(said.tolist(), speech.phones.ends_s, felt.tolist(), len(self.emotions))
            found = self.expectation.poses(self.bands(speech), told, self.fps, int(bounds[-1]))
            poses = list(np.split(found, bounds[1:-1]))
        asked = zip(each, heard, np.diff(bounds).tolist(), poses, strict=True)
        return [Wish(phone, emotion, features[a:b], count, pose) for (phone, emotion), (a, b), count, pose in asked]

    def numbers(self, phone: str, emotion: str) -> tuple[int, int]:
        """Of a phone and of an emotion; FacesynthError for those that nobody knows."""
        if emotion not in self.emotions:
            raise unknown("emotion", emotion, self.emotions)
        if phone not in PHONE_INDEX:
            raise unknown("phone", phone, PHONES)
        return PHONE_INDEX[phone], self.emotions.index(emotion)

    def report(self, speech: Speech) -> dict[str, float]:
        """Shares of phones said by another phone, viseme class or emotion; `plan(speech).summary()` tells more."""
        return shares_of_others(self.graph, self.plan(speech))

    def joins(self, speech: Speech) -> Ints:
        """First frames of the phones that were jumped to."""
        return speech.phones.frame_bounds(self.fps)[1:-1][self.plan(speech).jumps]

    def explain(self, speech: Speech, *, look_ahead: int | None = None) -> list[dict[str, Any]]:
        """Per phone: the chosen node, its cost terms, the runners-up by audio, and what it lacks."""
        plan = self.plan(speech, look_ahead=look_ahead)
        return explain(self.graph, plan, self.weights, self.utterances, self.emotions)

    def open_stream(self, *, look_ahead: int = 4) -> WishStream:
        """Something to push phones into and take frames from; `look_ahead` phones (the paper: 3 to 6) are waited for.

        A stream takes the cheapest path, whatever the temperature, and is not sharpened. It gives frames before its filter
        has quite forgotten what follows them.
        """
        return WishStream(self, look_ahead, round(GUARD_S * self.fps), round(REMEMBERED_S * self.fps))

    def stream_wishes(self, wishes: Iterable[Wish], *, look_ahead: int = 4) -> Iterator[NDArray[np.float32]]:
        """Frames [n, C] while phones arrive, as `open_stream` gives them."""
        stream = self.open_stream(look_ahead=look_ahead)
        for wish in wishes:
            yield stream.push(wish)
        yield stream.finish()

    def stream(self, *, look_ahead: int = 4, sample_rate: int | None = None) -> AnimeStream:
        """Sound and phones as they come in; a node is settled when `look_ahead` phones (the paper: 3 to 6) follow it."""
        if self.weights.pose > 0 or self.temperature > 0 or self.sharpening > 0:
            raise FacesynthError(
                "this model takes means over paths, expects poses or is sharpened: it wants whole utterances; for streams export "
                "one trained with temperature=0 pose_weight=0 sharpening=0"
            )
        if self.ear is None:
            raise FacesynthError("this model hears whole utterances alone; export it, and stream from the folder")
        checked_rate(RATE if sample_rate is None else sample_rate, RATE)
        return AnimeStream(self, self.ear(), look_ahead)
