"""What the reference methods can do."""

from facesynth.methods.capabilities import Capabilities

HOME = "facesynth.methods.baselines"
MEAN_FACE = Capabilities(
    "mean_face", "the mean of what was recorded", home=f"{HOME}.mean_face", needs_phones=False, reference="mean face"
)
PHONE_MEAN = Capabilities("phone_mean", "one pose for each phone", home=f"{HOME}.phone_mean", reference="phone mean")
VISEME_TABLE = Capabilities(
    "viseme_table", "one fixed shape for each viseme class, cross-faded", home=f"{HOME}.viseme_table", reference="viseme table"
)
RIDGE = Capabilities(
    "ridge", "a linear map from sound to motion", home=f"{HOME}.ridge", minutes=1.0, needs_phones=False, reference="ridge"
)
TCN = Capabilities(
    "tcn", "a small temporal convolution network", home=f"{HOME}.tcn", minutes=3.0, needs_phones=False, reference="tcn"
)
HEAD_REST = Capabilities(
    "head_rest", "the head rests", home=f"{HOME}.heads", part="head", needs_phones=False, reference="head at rest"
)
HEAD_RIDGE = Capabilities(
    "head_ridge",
    "a linear map from prosody to the head",
    home=f"{HOME}.heads",
    part="head",
    needs_phones=False,
    minutes=1.0,
    reference="head by ridge",
)
HEAD_SWAY = Capabilities(
    "head_sway",
    "the head sways by constants",
    home=f"{HOME}.sway",
    part="head",
    needs_phones=False,
    reference="head that sways",
)
EYES_RANDOM = Capabilities(
    "eyes_random",
    "gaze and blinks at random times, as often as recorded",
    home=f"{HOME}.random_eyes",
    part="eyes",
    needs_phones=False,
    reference="random eyes",
)
