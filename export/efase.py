"""Export an eFASE database: python export/efase.py efase.safetensors -o folder/ [--weights float16]."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("efase")
