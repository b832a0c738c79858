"""What the anime graph can do."""

from facesynth.methods.capabilities import (
    Accounting,
    Capabilities,
    Explaining,
    Joining,
    MappingEmotions,
    Option,
    Reporting,
    Streaming,
)

CAPABILITIES = Capabilities(
    "anime_graph",
    "recorded phones found by sound and joined by example, and maps between emotions (Cao 2005)",
    home="facesynth.methods.anime_graph.method",
    options=(Option("look_ahead", int, "Search so many phones ahead, as for streaming.", least=1),),
    abilities=frozenset({Explaining, Accounting, Reporting, Joining, MappingEmotions, Streaming}),
    minutes=3.0,
    exporter="facesynth.export.anime_graph:anime_graph_content",
)
