"""What co-articulation can do."""

from facesynth.methods.capabilities import Capabilities

CAPABILITIES = Capabilities(
    "coarticulation",
    "Deng 2006: key shapes of phones, blended by learned functions of time",
    home="facesynth.methods.coarticulation.method",
    minutes=1.0,
    tables=("arkit",),
    table_reader="facesynth.methods.coarticulation.by_hand:from_table",
    exporter="facesynth.export.coarticulation:coarticulation_content",
)
