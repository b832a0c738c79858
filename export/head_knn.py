"""Export a trained head model: python export/head_knn.py head_knn.safetensors -o folder/ [--weights float16]."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("head_knn")
