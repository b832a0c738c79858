"""From what is asked for to a path through the graph, with an account of it."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..phones import PHONES
from ..ragged import Made, Ragged
from .candidates import Candidates, Chooser, make_step
from .graph import VISEME_OF, Graph
from .search import NUMPY, PathSearch, Step, Weights, jumps, look_ahead_path, path_cost


@dataclass(frozen=True, eq=False)
class Wish:
    """What one phone of the input asks for."""

    phone: int
    emotion: int
    wanted: Floats
    """[m, P] audio features."""
    frames: int
    """Length of the phone in the output."""
    expected: Floats | None = None
    """[frames, D] pose that the sound leads one to expect, as components times metric; None where nothing predicts it."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A path through the graph for T phones."""

    wishes: Sequence[Wish]
    candidates: Sequence[Candidates]
    steps: Sequence[Step]
    path: Ints
    """[T] index of the chosen one among each phone's candidates."""
    cost: float
    """Eq. 2."""
    optimum: float
    """The least that any path costs."""

    @property
    def nodes(self) -> Ints:
        """[T] the chosen nodes."""
        return np.array([c.nodes[i] for c, i in zip(self.candidates, self.path, strict=True)])

    @property
    def jumps(self) -> NDArray[np.bool_]:
        """[T - 1] whether the step after each phone is a jump."""
        return jumps(self.steps, self.path)

    @property
    def extra_cost(self) -> float:
        """Share by which the path costs more than the best one: what looking only some phones ahead loses."""
        return self.cost / self.optimum - 1 if self.optimum > 0 else 0.0

    def summary(self) -> dict[str, Any]:
        """Counts: phones, jumps, fallbacks of phone and of emotion; the cost, and its share over the least possible."""
        phone_levels = Counter(c.phone_level for c in self.candidates)
        emotion_levels = Counter(c.emotion_level for c in self.candidates)
        return {
            "phones": len(self.path),
            "jumps": int(self.jumps.sum()),
            "cost": self.cost,
            "extra_cost": self.extra_cost,
            "phone_fallbacks": {k: v for k, v in phone_levels.items() if k != "phone"},
            "emotion_fallbacks": {k: v for k, v in emotion_levels.items() if k != "emotion"},
        }


def lay_steps(chooser: Chooser, wishes: Sequence[Wish], metric: Floats) -> tuple[list[Candidates], Sequence[Step]]:
    """Candidates and their costs for each phone; what is a phone's own of them lies in a file where it is much."""
    candidates = [chooser.candidates(wish.phone, wish.emotion) for wish in wishes]
    audio, pose, link = Ragged(), Ragged(), Ragged(np.int64)
    for c, before, wish in zip(candidates, [None, *candidates[:-1]], wishes, strict=True):
        step = make_step(chooser, c, before, wish.wanted, metric, wish.expected)
        audio.add(step.audio)
        link.add(step.link)
        pose.add(np.zeros(0) if step.pose is None else step.pose)

    def laid(t: int) -> Step:
        expected = pose[t] if wishes[t].expected is not None else None
        return Step(audio[t], *chooser.ends(candidates[t], metric), link[t], expected)

    return candidates, Made(laid, len(candidates))


def make_plan(
    chooser: Chooser,
    wishes: Sequence[Wish],
    metric: Floats,
    weights: Weights,
    look_ahead: int | None = None,
    search: PathSearch = NUMPY,
) -> Plan:
    """The globally best path, or the one that a look-ahead of some phones finds."""
    candidates, steps = lay_steps(chooser, wishes, metric)
    path, optimum = search.best_path(steps, weights)
    cost = optimum
    if look_ahead is not None:
        path = look_ahead_path(steps, weights, look_ahead)
        cost = max(optimum, path_cost(steps, path, weights))
    return Plan(wishes, candidates, steps, path, cost, optimum)


def shares_of_others(graph: Graph, plan: Plan) -> dict[str, float]:
    """Shares of phones said by another phone, viseme class or emotion."""
    phones, feelings = (np.array([getattr(w, name) for w in plan.wishes]) for name in ("phone", "emotion"))
    said, felt = graph.phones[plan.nodes], graph.emotions[plan.nodes]
    return {
        "other_phones": float((said != phones).mean()),
        "other_visemes": float((VISEME_OF[said] != VISEME_OF[phones]).mean()),
        "other_emotions": float((felt != feelings).mean()),
    }


def explain(graph: Graph, plan: Plan, weights: Weights, names: Sequence[str], emotions: Sequence[str]) -> list[dict[str, Any]]:
    """Per phone: the chosen node, its cost terms, the runners-up by audio, and whether phone and emotion are right.

    names: of the utterances; a node is called `utterance_id:phone_number`, which stays the same when a graph is built
    again.
    """
    labels = [f"{names[u]}:{n}" for u, n in zip(graph.utterances.tolist(), graph.numbers.tolist(), strict=True)]
    jumped, rows = [False, *plan.jumps.tolist()], []
    for t, (wish, node) in enumerate(zip(plan.wishes, plan.nodes.tolist(), strict=True)):
        step, chosen = plan.steps[t], plan.path[t]
        apart = np.linalg.norm(plan.steps[t - 1].last[plan.path[t - 1]] - step.first[chosen]) if jumped[t] else 0.0
        nearest = plan.candidates[t].nodes[np.argsort(step.audio, kind="stable")[:4]].tolist()
        rows.append(
            {
                "phone": PHONES[wish.phone],
                "emotion": emotions[wish.emotion],
                "node": labels[node],
                "jump": weights.jump * jumped[t],
                "jump_cost": weights.jump_cost * float(apart),
                "audio_cost": weights.audio * float(step.audio[chosen]),
                "pose_cost": 0.0 if step.pose is None else weights.pose * float(step.pose[chosen]),
                "right_phone": bool(graph.phones[node] == wish.phone),
                "right_viseme": plan.candidates[t].phone_level != "any phone",
                "right_emotion": bool(graph.emotions[node] == wish.emotion),
                "mapped": bool(plan.candidates[t].maps[chosen] >= 0),
                "nearest_by_audio": [labels[n] for n in nearest if n != node][:3],
            }
        )
    return rows
