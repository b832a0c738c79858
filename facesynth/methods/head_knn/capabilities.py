"""What the nearest recorded head movements can do."""

from pathlib import Path

from facesynth.methods.capabilities import Capabilities, Option

CAPABILITIES = Capabilities(
    "head_knn",
    "head motion from the nearest recorded movements, through key poses (Deng 2006, §4.3)",
    home="facesynth.methods.head_knn.method",
    needs_phones=False,
    part="head",
    options=(
        Option(
            "head_keys",
            Path,
            "CSV of key poses: time_s and, in degrees, pitch, yaw, roll.",
            reader="facesynth.inference.head.keys:read_head_keys",
        ),
    ),
    minutes=1.0,
    exporter="facesynth.export.head:knn_content",
)
