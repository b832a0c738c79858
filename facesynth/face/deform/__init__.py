"""A mesh moved by markers themselves, without shapes between."""
