"""What eFASE can do."""

from pathlib import Path

from facesynth.methods.capabilities import Accounting, Browsing, Capabilities, Editing, Explaining, Joining, Option, Reporting

CAPABILITIES = Capabilities(
    "efase",
    "the cheapest path through recorded motion nodes, one for each phone (Deng & Neumann 2008)",
    home="facesynth.methods.efase.method",
    options=(
        Option(
            "constraints",
            Path,
            "CSV of nodes that must be used: phone_index or time_s, utterance_id, phone_number.",
            reader="facesynth.methods.efase.constraints:read_constraints",
        ),
        Option(
            "edits",
            Path,
            "Nodes that must not be used and drawn ones that may be, as in a corpus's edits.jsonl, without training anew.",
            reader="facesynth.methods.efase.edits:read_edits",
        ),
    ),
    abilities=frozenset({Explaining, Accounting, Reporting, Joining, Editing, Browsing}),
    nearest={
        "penalty": 34.37,
        "alpha": 1.042,
        "beta": 0.3133,
        "eta": 0.1079,
        "gamma": 0.3088,
        "delta": 0.0636,
        "phi": 0.01373,
        "temperature": 1.0,
        "candidates": 60,
        "pose_weight": 1.0,
        "features": "both",
        "expected_share": 0.5,
        "sharpening": 1.0,
        "residual": 1.0,
        "learn": True,
    },
    minutes=5.0,
    of_each_phone=5,
    exporter="facesynth.export.efase:efase_content",
    tuner="facesynth.methods.efase.tuning:tuned",
)
