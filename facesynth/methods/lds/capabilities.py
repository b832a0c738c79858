"""What the linear dynamical system can do."""

from facesynth.methods.capabilities import Capabilities, Option

CAPABILITIES = Capabilities(
    "lds",
    "a linear dynamical system driven by sound, with random motion of its own (Saisan 2004)",
    home="facesynth.methods.lds.method",
    needs_phones=False,
    options=(Option("noise", float, "Amount of random motion; 1 as learned, 0 none.", least=0),),
    minutes=1.0,
    exporter="facesynth.export.lds:lds_content",
)
