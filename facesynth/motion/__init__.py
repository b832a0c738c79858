"""Facial movement and its mathematics, free of any method."""
