"""Cao, Tien, Faloutsos, Pighin: Expressive Speech-Driven Facial Animation (2005)."""
