"""A real speaker's picture, moved: points tracked in video, warped frames, and their composition."""
