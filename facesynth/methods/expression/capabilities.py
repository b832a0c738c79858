"""What a model of expressions can do."""

from facesynth.methods.capabilities import Capabilities, Expressing

CAPABILITIES = Capabilities(
    "expression",
    "Deng 2006: recorded signals of what an emotion adds to a neutral face, grown anew and added to any method's motion",
    home="facesynth.methods.expression.method",
    part="expression",
    abilities=frozenset({Expressing}),
    hears_phones=False,
    exporter="facesynth.export.expression:expression_content",
)
