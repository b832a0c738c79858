"""Markerless capture: from ordinary video to the motion of a face."""
