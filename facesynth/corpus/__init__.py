"""A performer's recordings: on disk, and as something to learn from."""

from facesynth.corpus.corpus import Corpus, MotionArrays
from facesynth.corpus.journal import AddedNode, node_name, parse_node
from facesynth.corpus.record import Record
from facesynth.corpus.utterance import Utterance

__all__ = ["AddedNode", "Corpus", "MotionArrays", "Record", "Utterance", "node_name", "parse_node"]
