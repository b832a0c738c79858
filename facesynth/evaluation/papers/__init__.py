"""The papers' own tables and figures, as far as a corpus and what is implemented allow."""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass

from facesynth.corpus import Corpus
from facesynth.evaluation.folds import make_folds, minutes_of, some_of
from facesynth.evaluation.papers.figure import Figure
from facesynth.evaluation.papers.finding import Reproduction
from facesynth.inference.errors import unknown
from facesynth.progress import track

REFERENCES = {
    "cao2005": "Cao, Tien, Faloutsos, Pighin: Expressive Speech-Driven Facial Animation, ACM TOG 2005",
    "deng2008": "Deng, Neumann: Expressive Speech Animation Synthesis with Phoneme-Level Controls, CGF 2008",
    "deng2006": "Deng: Data-Driven Facial Animation Synthesis, dissertation, USC 2006",
    "saisan2004": "Saisan, Bissacco, Chiuso, Soatto: Modeling and Synthesis of Facial Motion Driven by Speech, ECCV 2004",
}


@dataclass(frozen=True, eq=False)
class Material:
    """What figures are measured on."""

    corpus: Corpus
    train: Corpus
    test: Corpus
    seed: int

    @property
    def unlike(self) -> str:
        """Why a figure that depends on the recordings is not the paper's."""
        kind = "a synthetic performer" if self.corpus.synthetic else "another performer"
        return f"{kind}, {self.corpus.fps:g} fps, other sentences"


def reproduce(
    paper: str, corpus: Corpus, *, train_minutes: float | None = None, test_limit: int = 24, seed: int = 0
) -> Reproduction:
    """Run what can be run of a paper, the `FIGURES` of its module, on a corpus; a fifth of the sentences is tested on."""
    if paper not in REFERENCES:
        raise unknown("paper", paper, REFERENCES)
    sentences = {record.sentence_key for record in corpus.usable_records}
    fold = make_folds(corpus, min(5, len(sentences)), seed, train_minutes=train_minutes)[0]
    few = some_of(fold.test, test_limit, seed)
    material = Material(corpus, corpus.subset(fold.train), corpus.subset(few), seed)
    figures: Sequence[Figure] = importlib.import_module(f"{__name__}.{paper}").FIGURES
    setting = (
        f"Ours: {corpus.performer}{' (synthetic)' if corpus.synthetic else ''}, {minutes_of(corpus, fold.train):.1f} minutes "
        f"({len(fold.train)} utterances) learned from, {len(few)} utterances of other sentences tested; "
        f"corpus sha256 {corpus.provenance()['sha256'][:16]}, seed {seed}."
    )
    found = [one for figure in track(figures, paper, len(figures)) for one in figure.findings(material)]
    return Reproduction(paper, REFERENCES[paper], setting, tuple(found))
