"""Eyes: blinks and gaze, grown from patches of recorded ones."""
