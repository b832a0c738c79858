"""Export an anime graph: python export/anime_graph.py anime_graph.safetensors -o folder/ [--weights float16]."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("anime_graph")
