"""The built-in performer: a synthetic actor, so that everything runs with nothing recorded."""
