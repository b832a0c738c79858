"""Heads that move, and the movement of recorded points carried over to them."""
