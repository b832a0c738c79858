"""Judging any method on any corpus."""
