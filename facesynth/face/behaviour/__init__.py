"""What a face does that nobody recorded: blinks, gaze, the tongue."""
