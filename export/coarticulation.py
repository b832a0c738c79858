"""Export a co-articulation model: python export/coarticulation.py coarticulation.safetensors -o folder/."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("coarticulation")
