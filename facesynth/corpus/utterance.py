"""Speech with the motion that was recorded with it."""

from dataclasses import dataclass

from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech


@dataclass(frozen=True, eq=False)
class Utterance:
    """Speech with the motion that was recorded with it, of equal length.

    The motion has exactly `speech.phones.frame_bounds(motion.fps)[-1]` frames. Short gaps are filled; frames in
    longer gaps, and those that the recording lacks at its end, are NaN.
    """

    id: str
    speech: Speech
    motion: Motion
    sentence: str
    """Equal for the same words in other emotions and takes."""
    take: int
    performer: str

    @property
    def emotion(self) -> str:
        """The emotion that fills most of the utterance."""
        track = self.speech.emotions
        lengths = dict.fromkeys(track.labels, 0.0)
        start = 0.0
        for label, end in zip(track.labels, track.ends_s, strict=True):
            lengths[label] += end - start
            start = end
        return max(lengths, key=lambda label: lengths[label])
