"""What a recording may lack and still be used: `add` refuses what `check` calls grave."""

LARGEST_MISSING_SHARE = 0.5
"""Of a motion's samples that may be missing, and of a sound that may have no motion."""
LARGEST_DIFFERENCE_S = 0.1
"""Sound and motion of one recording may differ so much in length without a word."""
