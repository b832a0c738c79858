"""Talking, feeling faces driven by speech, learned from recordings of one performer."""

__version__ = "0.1.0"
