"""Export a model of eyes: python export/eyes.py eyes.safetensors -o folder/."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("eyes")
