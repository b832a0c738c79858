"""Salient points of one speaker's lower face, followed through video: a shape in every picture."""
