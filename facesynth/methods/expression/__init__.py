"""Expressions apart from speech: what an emotion adds to a neutral face (Deng 2006, §5.2)."""
