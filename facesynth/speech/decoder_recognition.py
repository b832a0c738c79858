"""Phones of a sound of which nobody knows the words, by pocketsphinx: where the phone network is not installed."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import PhoneTrack
from facesynth.progress import track
from facesynth.speech.audio import SILENT_DB, loudest_db, no_speech, require_sound
from facesynth.speech.decoding import decode, decoder_sound, heard_time, model_file, new_decoder
from facesynth.speech.fitting import SLOWNESS, fit_phones
from facesynth.speech.phone_labels import normalise_phone
from facesynth.speech.pieces import quiet_pieces
from facesynth.speech.segments import Segment, in_one, phone_track
from facesynth.speech.transcript import words_of

FLUENT_FIT = -65.0
"""Fit of likely words to the sound above which they are believed."""
_ONE_PASS = {"fwdflat": False, "bestpath": False, "maxhmmpf": 3000, "maxwpf": 5}
"""One pass with few candidates takes a third of the time of the usual three and gives no more wrong phones."""


def recognise_by_decoder(audio: NDArray[np.float32], rate: int) -> PhoneTrack:
    """Phones heard in a sound [S], -1..1, at `rate` Hz, of any length.

    Likely English words are looked for first, because what words can follow one another says much about phones; they
    need not be the right words to be nearly the right phones. Where none fit (songs, other languages) phones are
    recognised singly. FacesynthError where the sound is too short, silent, or holds no speech.
    """
    require_sound(audio, rate)
    pieces = [
        (start / rate, (stop - start) / rate, _phones_in(audio[start:stop], rate))
        for start, stop in track(quiet_pieces(audio, rate), "listen")
    ]
    phones = phone_track(in_one(pieces), len(audio) / rate)
    if set(phones.labels) == {SILENCE}:
        raise no_speech()
    return phones


def _phones_in(audio: NDArray[np.float32], rate: int) -> list[Segment]:
    if loudest_db(audio, rate) < SILENT_DB:
        return []
    words = _likely_words(audio, rate)
    found = fit_phones(audio, rate, words) if words else None
    if found is not None and found.fit >= FLUENT_FIT:
        return list(found.phones)
    decoder = new_decoder(allphone=model_file("en-us-phone.lm.bin"), lw=4, beam=1e-20, pbeam=1e-20)
    decode(decoder, decoder_sound(audio, rate, SLOWNESS[0]))
    return list(_single_phones(decoder))


def _likely_words(audio: NDArray[np.float32], rate: int) -> tuple[str, ...]:
    decoder = new_decoder(lm=model_file("en-us.lm.bin"), dict=model_file("cmudict-en-us.dict"), **_ONE_PASS)
    decode(decoder, decoder_sound(audio, rate, SLOWNESS[0]))
    heard = (entry.word.partition("(")[0] for entry in _entries(decoder))
    return words_of(" ".join(word for word in heard if word[0].isalpha() or word[0] == "'"))


def _single_phones(decoder: Any) -> Iterator[Segment]:
    for entry in _entries(decoder):
        times = heard_time(entry.start_frame, SLOWNESS[0]), heard_time(entry.end_frame + 1, SLOWNESS[0])
        yield normalise_phone(entry.word), *times


def _entries(decoder: Any) -> Iterable[Any]:
    return decoder.seg() or () if decoder.hyp() is not None else ()
