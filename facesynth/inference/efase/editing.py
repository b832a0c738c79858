"""Speech that somebody edits: after each change only what changed is searched, and any part of the motion can be had alone.

An `EfaseEditor` keeps what its searches found (`kept`). A change at one phone searches from that phone to the end of its
stretch of speech; a change of times alone searches nothing where nothing is heard. The draft that comes of it makes the motion
of a window from the phones around it, which is what an editor shows first, and of the whole, which is what
`Efase.synthesize` gives.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..efase.costs import Query
from ..efase.explanation import explain
from ..efase.kept import STRETCHES, KeptHearing, KeptMatrices, KeptSearches, Memory, query_key
from ..efase.model import Efase
from ..efase.plan import Plan, Solved
from ..efase.search import Engine
from ..efase.window import REACH_S, window
from ..errors import FacesynthError, reject_options
from ..motion import Motion
from ..phones import SILENCE
from ..speech import Speech, frame_bounds

SHARES = 4
"""Decimals of a share in a mean over nodes below which a change is none that could be seen."""


@dataclass(frozen=True, eq=False)
class EfaseDraft:
    """A speech and the nodes that were found for it."""

    model: Efase
    speech: Speech
    plans: Sequence[Plan]
    changed_s: tuple[float, float] | None
    """From where to where its motion may look otherwise than that of the editor's draft before it; None: nowhere."""

    def motion(self, start_s: float = 0.0, stop_s: float | None = None) -> Motion:
        """The whole, or of its frames those from `start_s` to `stop_s`, made from the phones around them."""
        model, speech = self.model, self.speech
        end_s = speech.duration_s if stop_s is None else stop_s
        count = int(frame_bounds(speech.phones.ends_s, model.fps)[-1])
        first, stop = (min(max(round(at_s * model.fps), 0), count) for at_s in (start_s, end_s))
        if first >= stop:
            raise FacesynthError(f"{start_s:g} to {end_s:g} s holds no frame of a motion of {speech.duration_s:.3f} s")
        if (first, stop) == (0, count):
            return model.moved(speech, self.plans)
        return Motion(window(model, self.plans, speech, first, stop), model.fps, model.layout)

    def choices(self) -> list[dict[str, Any]]:
        """Chosen node and cost terms for each phone, as `explain` has them, without runners-up."""
        model, plan = self.model, self.plans[0]
        return explain(model.nodes, model.names, model.emotions, plan.query, plan.nodes, model.weights, runners_up=0)

    def marks(self) -> list[Hashable]:
        """For each phone what its motion is made from, as far as a difference could be seen."""
        feelings, intensity = self.speech.emotions.per_phone(self.speech.phones)
        bounds = self.speech.phones.frame_bounds(self.model.database_fps).tolist()
        labels, ends_s = self.speech.phones.labels, self.speech.phones.ends_s.tolist()
        return [
            (
                labels[t],
                bounds[t],
                bounds[t + 1],
                ends_s[t],
                feelings[t],
                intensity[t],
                *(self._mark(plan, t, bounds) for plan in self.plans),
            )
            for t in range(len(labels))
        ]

    def _mark(self, plan: Plan, t: int, bounds: Sequence[int]) -> Hashable:
        names, mixture = self.model.names, plan.mixtures[t] if plan.mixtures is not None else None
        shown = plan.nodes[t] < 0 or self.model.settings.expected_share > 0 or self.model.parts.shares is not None
        expected = (
            None if plan.expected is None or not shown else plan.expected[bounds[t] : bounds[t + 1]].round(SHARES).tobytes()
        )
        if mixture is not None:
            mixed = tuple(names[node] for node in mixture.nodes.tolist())
            return (mixed, mixture.shares.round(SHARES).tobytes(), round(mixture.captured, SHARES), expected)
        return (names[plan.nodes[t]] if plan.nodes[t] >= 0 else None, expected)


class EfaseEditor:
    """`change` after `change` of one speech, or of one speech after the other."""

    def __init__(self, model: Efase) -> None:
        self.model = _remembering(model)

    def change(
        self,
        speech: Speech,
        *,
        seed: int = 0,
        constraints: Mapping[int, str] | None = None,
        after: EfaseDraft | None = None,
        **options: Any,
    ) -> EfaseDraft:
        """The draft of a speech, beside the one before it; `fps` and `look_ahead` are no options of an editor's."""
        reject_options("efase", options, ("seed", "constraints"))
        draft = EfaseDraft(self.model, speech, self.model.plans(speech, constraints=constraints), (0.0, speech.duration_s))
        return draft if after is None else replace(draft, changed_s=_changed_s(after, draft))


class _Remembering(Efase):
    """The same model with a memory of stretches."""

    def __init__(self, *parts: Any) -> None:
        super().__init__(*parts)
        self._solved: Memory[Solved] = Memory(STRETCHES)

    def solved(self, query: Query, engine: Engine | None = None) -> Solved:
        """See `Efase.solved`."""
        return self._solved.of(query_key(query), lambda: super(_Remembering, self).solved(query, engine))


def _remembering(model: Efase) -> Efase:
    """A model whose parts remember."""
    parts = model.parts
    hearing = None if parts.hearing is None else KeptHearing.of(parts.hearing)
    engine = parts.engine or KeptSearches(model.index)
    return _Remembering(replace(parts, hearing=hearing, engine=engine, step_matrix=KeptMatrices()))


def _changed_s(before: EfaseDraft, after: EfaseDraft) -> tuple[float, float] | None:
    """The phones at which two drafts differ, silence beside them, and as far as their motion reaches."""
    old, new, labels = before.marks(), after.marks(), after.speech.phones.labels
    same = [a == b for a, b in zip(old, new, strict=False)]
    head = same.index(False) if False in same else len(same)
    if head == len(old) == len(new):
        return None
    same = [a == b for a, b in zip(old[::-1], new[::-1], strict=False)]
    tail = min(same.index(False) if False in same else len(same), len(new) - 1 - min(head, len(new) - 1))
    first, stop = min(head, len(new) - 1), len(new) - tail
    while first > 0 and labels[first - 1] == SILENCE:
        first -= 1
    while stop < len(new) and labels[stop] == SILENCE:
        stop += 1
    phones = after.speech.phones
    start_s, end_s = float(phones.starts_s[first]), float(phones.ends_s[stop - 1])
    return max(start_s - REACH_S, 0.0), min(end_s + REACH_S, phones.duration_s)
