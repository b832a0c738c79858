"""Nodes that had better be looked at, the worst first: what the check of a corpus names, and what lies far from its kind."""

from collections import defaultdict
from dataclasses import dataclass

from facesynth.corpus import Corpus
from facesynth.corpus.checks.check import node_problems
from facesynth.methods.capabilities import Browsing
from facesynth.motion.maps.outliers import remoteness
from facesynth.progress import track

REMOTE = 2.5
"""So many times as far from its neighbours as the median node of its phone: of a clean corpus about one node in a hundred."""
CHECKED = 10.0
"""What the check finds counts as much as such a distance."""


@dataclass(frozen=True)
class Suspect:
    """A node that may be contaminated."""

    node: str
    phone: str
    emotion: str
    score: float
    """The higher the more suspicious; 1 is a node like others."""
    reasons: tuple[str, ...]


def suspects(corpus: Corpus, model: Browsing | None = None) -> list[Suspect]:
    """Of nodes that are not removed, by falling score; without a model by the check alone."""
    removed, found = corpus.removed_nodes(), dict[str, tuple[str, str]]()
    scores, reasons = defaultdict[str, float](lambda: 1.0), defaultdict[str, list[str]](list)
    if model is not None:
        for phone in track(model.mapped_phones(), "maps"):
            cluster = model.phone_map(phone, "pca").cluster
            for name, emotion, far in zip(cluster.names, cluster.emotions, remoteness(cluster).tolist(), strict=True):
                found[name], scores[name] = (phone, emotion), far
                if far >= REMOTE:
                    reasons[name].append(f"{far:.1f} times as far from its neighbours as others of {phone}")
    for problem in node_problems(corpus):
        for node in problem.nodes:
            scores[node] += CHECKED
            reasons[node].append(problem.what)
    listed = sorted((name for name in reasons if name not in removed), key=lambda name: (-scores[name], name))
    return [
        Suspect(name, *(found.get(name) or _said(corpus, name)), round(scores[name], 2), tuple(reasons[name])) for name in listed
    ]


def _said(corpus: Corpus, name: str) -> tuple[str, str]:
    """Phone and emotion of a node that is in no model."""
    utterance_id, _, number = name.rpartition(":")
    speech = corpus[utterance_id].speech
    feelings, _ = speech.emotions.per_phone(speech.phones)
    return speech.phones.labels[int(number)], feelings[int(number)]
