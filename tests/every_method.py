"""Every known method, with settings that switch on all that it has and keep its learning short."""

from facesynth.methods.registry import create, list_methods

SETTINGS = {
    "efase": {"audio_weight": 1.0, "pose_weight": 1.0, "expected_share": 0.5, "residual": 1.0},
    "anime_graph": {"pose_weight": 1.0},
    "eyes": {"patch_s": 0.5},
    "lds": {"deterministic_order": 2, "stochastic_order": 2, "lead_ms": 0.0},
    "head_knn": {"starts": 2, "validation": 2},
    "tcn": {"steps": 3},
    "network": {"steps": 3, "residual": 1.0},
}
"""Of those whose defaults leave something off, need longer recordings or learn long."""
METHODS = {name: SETTINGS.get(name, {}) for name in list_methods()}


def trained_on(corpus, name, patch, device="cpu"):
    """A method that learned from a corpus, its networks in three steps."""
    patch.setattr("facesynth.methods.learn.expectation.STEPS", 3)
    return create(name, **METHODS[name]).to(device).fit(corpus)
