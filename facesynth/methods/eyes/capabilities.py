"""What learned eyes can do."""

from facesynth.methods.capabilities import Accounting, Capabilities, Looking

CAPABILITIES = Capabilities(
    "eyes",
    "Deng 2006: lids and gaze, grown together from patches of recorded ones",
    home="facesynth.methods.eyes.method",
    needs_phones=False,
    part="eyes",
    abilities=frozenset({Accounting, Looking}),
    minutes=1.0,
    exporter="facesynth.export.eyes:eyes_content",
)
