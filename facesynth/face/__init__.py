"""Faces to show motion on: rigs, deformation, pictures, files."""
