"""What the network of poses can do."""

from facesynth.methods.capabilities import Capabilities

CAPABILITIES = Capabilities(
    "network",
    "dilated convolutions from sound, phones and emotion to poses",
    home="facesynth.methods.network.method",
    by_sound={"phones": False},
    minutes=2.0,
    reference="network",
    exporter="facesynth.export.network:network_content",
)
