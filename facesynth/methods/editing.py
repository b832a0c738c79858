"""Editors for every method: its own where it has one, else one that makes everything anew."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from facesynth.inference.errors import FacesynthError, reject_options
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Editing, Editor, Explaining
from facesynth.methods.registry import ask
from facesynth.methods.trained import TrainedModel


def editor_of(method: TrainedModel) -> Editor:
    """Whatever is quickest for this method."""
    editing = ask(method, Editing)
    return PlainEditor(method) if editing is None else editing.edit()


@dataclass(frozen=True, eq=False)
class PlainDraft:
    """A speech whose motion is made whole when its first part is asked for."""

    method: TrainedModel
    speech: Speech
    options: dict[str, Any]
    changed_s: tuple[float, float] | None

    @cached_property
    def _whole(self) -> Motion:
        return self.method.synthesize(self.speech, **self.options)

    def motion(self, start_s: float = 0.0, stop_s: float | None = None) -> Motion:
        """See `Draft.motion`."""
        whole = self._whole
        end_s = whole.duration_s if stop_s is None else stop_s
        first, stop = (min(max(round(at_s * whole.fps), 0), len(whole)) for at_s in (start_s, end_s))
        if first >= stop:
            raise FacesynthError(f"{start_s:g} to {end_s:g} s holds no frame of a motion of {whole.duration_s:.3f} s")
        head, eyes = (None if part is None else part[first:stop] for part in (whole.head, whole.eyes))
        return replace(whole, frames=whole.frames[first:stop], head=head, eyes=eyes)

    def choices(self) -> list[dict[str, Any]]:
        """See `Draft.choices`."""
        explaining = ask(self.method, Explaining)
        options = {name: value for name, value in self.options.items() if name != "seed"}
        return [] if explaining is None else explaining.explain(self.speech, **options)


class PlainEditor:
    """Synthesises anew after each change."""

    def __init__(self, method: TrainedModel) -> None:
        self.method = method

    def change(self, speech: Speech, *, seed: int = 0, **options: Any) -> PlainDraft:
        """See `Editor.change`."""
        known = [option.name for option in self.method.capabilities.options]
        reject_options(self.method.name, options.keys() - set(known), ("seed", *known))
        return PlainDraft(self.method, speech, {"seed": seed, **options}, (0.0, speech.duration_s))
