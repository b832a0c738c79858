"""What a model of expressions can do."""

from facesynth.methods.capabilities import Capabilities, Expressing

CAPABILITIES = Capabilities(
    "expression",
    "Deng 2006: what an emotion adds to a neutral face, as phones tell it and varied as recorded; added to any method's motion",
    home="facesynth.methods.expression.method",
    part="expression",
    abilities=frozenset({Expressing}),
    exporter="facesynth.export.expression:expression_content",
)
