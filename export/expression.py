"""Export a model of expressions: python export/expression.py expression.safetensors -o folder/."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("expression")
