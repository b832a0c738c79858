"""Export a trained linear dynamical system: python export/lds.py lds.safetensors -o folder/ [--weights float16]."""

from pathlib import Path

from facesynth.cli.export import export

if __name__ == "__main__":
    export(prog_name=Path(__file__).name)
