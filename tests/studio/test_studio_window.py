"""What a window is shown first, and that it is the face that `speak` makes."""

import numpy as np
import pytest

from facesynth.inference.motion import Motion
from facesynth.methods.efase.method import Efase
from facesynth.motion.gaps import for_looking
from facesynth.stage.cast import cast_for
from facesynth.stage.performance import HeadStage
from facesynth.stage.request import Request
from facesynth.studio.commands import changed
from facesynth.studio.document import Document, first_take, take_facts
from facesynth.studio.performing import Performing
from facesynth.studio.speak_files import arguments, request_of, write_take
from facesynth.studio.window import near_first

HERE = {"line": "a", "take": "1"}


@pytest.mark.parametrize(
    ("duration_s", "at_s", "sight_s"),
    [(0.4, 0.0, (0, 0.4)), (3.2, 1.5, (0, 3.2)), (600.0, 312.3, (300, 330)), (12.0, 12.0, (11, 12)), (5.0, 99.0, (0, 900))],
)
def test_every_second_is_made_once_those_at_the_playhead_first(duration_s, at_s, sight_s):
    order = near_first(duration_s, at_s, sight_s)
    seconds = [k for batch in order for k in batch]
    assert sorted(seconds) == list(range(int(np.ceil(duration_s))))
    assert min(int(at_s), len(seconds) - 1) in order[0]
    assert len(order[0]) <= 4
    in_sight = set(range(int(sight_s[0]), int(np.ceil(sight_s[1])))) & set(seconds)
    assert set(seconds[: len(order[0]) + len(in_sight)]) >= in_sight


@pytest.fixture(scope="module")
def played(tiny, rig):
    """A model, a line of the corpus, and where its sound is."""
    utterance = tiny[tiny.ids[3]]
    take = take_facts(first_take(utterance.speech.phones, (), utterance.speech.emotions))
    document = changed(Document(), "add_line", {"name": "a", "text": "", "take": take, "utterance": utterance.id})
    return Efase().fit(tiny), document, tiny.files.audio(utterance.id)


def face(performing, document, sound):
    line = document.line("a")
    return performing.whole(sound, None, line, line.takes[0]).rows


def test_stretches_that_were_not_stale_are_those_of_the_whole(played):
    """Only what may have changed is sent again: laid into the old face it gives the new one."""
    model, document, sound = played
    performing, known = Performing.of(model), None
    changes = [("move_boundary", {"phone": 4, "end_s": document.line("a").takes[0].phones[4].end_s + 0.01})]
    changes += [("paint_emotion", {"start_s": 0.0, "end_s": 0.4, "emotion": "happy", "intensity": 0.5})]
    changes += [("relabel", {"phone": 3, "label": "m"})]
    known = face(performing, document, sound).copy()
    sent = dict.fromkeys(range(4), performing.generation)
    for do, what in changes:
        document = changed(document, do, {**HERE, **what})
        line = document.line("a")
        now = performing.change(sound, None, line, line.takes[0])
        for k in range(int(np.ceil(now.speech.duration_s))):
            if performing.stale(sent[k], k, k + 1):
                part = performing.stretch(now, k, k + 1)
                known[part.start : part.start + len(part.rows)] = part.rows
                sent[k] = performing.generation
        fresh = face(Performing.of(model), document, sound)
        np.testing.assert_allclose(known, fresh, atol=0.06)  # windows are solved with a tenth of a second around them
        assert np.abs(known - fresh).mean() < 0.001


def test_what_is_shown_is_what_speak_makes(played, tmp_path):
    """The page sees the weights that are exported, as far as solving at another rate lets it."""
    model, document, sound = played
    document = changed(document, "pin", {**HERE, "phone": 3, "node": model.facts["names"][7]})
    take = document.line("a").takes[0]
    write_take(tmp_path, take)
    request = request_of(take, tmp_path, None, model.capabilities)
    cast = cast_for(model, request)
    performing = Performing.of(model)
    speech = performing.speech(sound, document.line("a"), take)
    exported = (
        HeadStage.of(request).perform(cast.motion(speech, request, cast.options(request, speech.phones)), speech, cast).animation
    )
    shown = face(performing, document, sound)
    assert len(shown) == len(exported)
    assert np.abs(shown[:, :52] - exported.weights).mean() < 0.02


def test_a_recording_with_holes_can_be_looked_at(tiny):
    motion = tiny[tiny.ids[0]].motion
    frames = motion.frames.copy()
    frames[:10], frames[20:60, :3], frames[:, 6:9] = np.nan, np.nan, np.nan
    whole = for_looking(Motion(frames, motion.fps, motion.layout))
    assert np.isfinite(whole.frames).all()
    present = np.isfinite(frames)
    np.testing.assert_allclose(whole.frames[present], frames[present], atol=1e-4)
    np.testing.assert_allclose(whole.frames[:, 6:9], np.tile(motion.layout.neutral[6:9], (len(frames), 1)), atol=1e-4)


def test_what_is_exported_is_on_the_head_that_is_shown(played, tmp_path):
    """The command line names the head, as the studio was started with it."""
    model, document, _ = played
    take = document.line("a").takes[0]
    shown = Request(rig=tmp_path / "my head.glb", mapping=tmp_path / "map.yaml")
    request = request_of(take, tmp_path, None, model.capabilities, shown)
    words = arguments(tmp_path / "m.safetensors", tmp_path / "a.wav", request, take, [tmp_path / "a.mp4"])
    assert (request.rig, request.mapping) == (shown.rig, shown.mapping)
    assert words[words.index("--rig") + 1] == str(shown.rig)
    assert words[words.index("--mapping") + 1] == str(shown.mapping)
