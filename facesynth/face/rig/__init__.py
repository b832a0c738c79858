"""Heads that move: the built-in one with ARKit's 52 shapes, and heads of one's own."""
