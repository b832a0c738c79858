"""Export what moves the built-in head (deformation, ARKit weights, picture warp): python export/face.py -o folder/."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("face")
