"""Phones of a sound of which nobody knows the words."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.errors import FacesynthError
from facesynth.speech.audio import require_sound
from facesynth.speech.decoding import decode, decoder_sound, heard_time, model_file, new_decoder
from facesynth.speech.phones import SILENCE, normalise_phone
from facesynth.speech.segments import Segment, phone_track
from facesynth.speech.speech import PhoneTrack

SLOWNESS = 1.06


def recognise(audio: NDArray[np.float32], rate: int) -> PhoneTrack:
    """Phones heard in a sound [S], -1..1, at `rate` Hz, of any language, as far as English phones can say it.

    FacesynthError where the sound is too short, silent, or holds no speech.
    """
    require_sound(audio, rate)
    duration_s = len(audio) / rate
    decoder = new_decoder(allphone=model_file("en-us-phone.lm.bin"), lw=2, beam=1e-20, pbeam=1e-20)
    decode(decoder, decoder_sound(audio, rate, SLOWNESS))
    track = phone_track(_inside(decoder, duration_s), duration_s)
    if set(track.labels) == {SILENCE}:
        raise FacesynthError("no speech is heard in the sound; give a recording of a voice, or a file of phones")
    return track


def _inside(decoder: Any, duration_s: float) -> Iterable[Segment]:
    """What the decoder heard, cut to the sound."""
    for entry in decoder.seg():
        start_s = max(heard_time(entry.start_frame, SLOWNESS), 0.0)
        end_s = min(heard_time(entry.end_frame + 1, SLOWNESS), duration_s)
        if end_s - start_s > 1e-3:
            yield normalise_phone(entry.word), start_s, end_s
