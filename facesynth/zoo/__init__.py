"""Models that can be used at once: what they are, where they lie, how they are carried from one place to another."""
