"""Export a trained linear dynamical system: python export/lds.py lds.safetensors -o folder/ [--weights float16]."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("lds")
