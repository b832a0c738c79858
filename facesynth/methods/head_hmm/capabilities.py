"""What hidden Markov models of the head can do."""

from facesynth.methods.capabilities import Capabilities

CAPABILITIES = Capabilities(
    "head_hmm",
    "head turns from prosody, by a hidden Markov model for each cluster of rotations (Deng 2006, §4.4)",
    home="facesynth.methods.head_hmm.method",
    needs_phones=False,
    part="head",
    minutes=2.0,
    exporter="facesynth.export.head:hmm_content",
)
