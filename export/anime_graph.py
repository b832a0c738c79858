"""Export an anime graph: python export/anime_graph.py anime_graph.safetensors -o folder/ [--weights float16]."""

from pathlib import Path

from facesynth.cli.export import export

if __name__ == "__main__":
    export(prog_name=Path(__file__).name)
