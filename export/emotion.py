"""Export an emotion detector: python export/emotion.py emotion.safetensors -o folder/ [--weights float16]."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("emotion")
