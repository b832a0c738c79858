"""A window of the preview shows what the export will show there."""

from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.inference.speech import EmotionTrack, PhoneTrack
from facesynth.methods.registry import create
from facesynth.stage.cast import cast_for
from facesynth.stage.performance import HeadStage
from facesynth.stage.preview import Preview
from facesynth.stage.request import Request


@pytest.fixture(scope="module")
def corpus(tmp_path_factory, rig):
    return tiny_corpus(tmp_path_factory.mktemp("preview") / "corpus", 6, fps=60)


def test_a_window_shows_what_is_exported(corpus):
    model, speech, request = create("efase").fit(corpus), next(iter(corpus)).speech, Request()
    cast = cast_for(model, request)
    preview = Preview(cast, request)
    for said in (speech, replace(speech, emotions=EmotionTrack.constant("sad", speech.duration_s))):
        now = preview.change(said, request)
        wanted = HeadStage.of(request).perform(cast.motion(said, request, {}), said, cast).animation
        part = now.animation(0.5, 1.0)
        there = slice(15, 15 + len(part))
        assert (part.fps, len(part), part.names) == (30.0, 15, wanted.names)
        assert np.abs(part.weights - wanted.weights[there]).mean() < 0.02
        assert np.abs(part.head - wanted.head[there]).max() < 0.05
        assert len(now.animation()) == round(speech.duration_s * 30)


def test_head_and_eyes_are_made_once_for_a_sound(corpus, monkeypatch):
    from facesynth.stage import preview as module

    made = []
    whole_face = module.whole_face
    monkeypatch.setattr(module, "whole_face", lambda *given: made.append(1) or whole_face(*given))
    model, speech, request = create("phone_mean").fit(corpus), next(iter(corpus)).speech, Request()
    preview = Preview(cast_for(model, request), request)
    preview.change(speech, request).animation(0, 0.2)
    ends_s = speech.phones.ends_s.copy()
    ends_s[3] = (ends_s[2] + ends_s[4]) / 2
    preview.change(replace(speech, phones=PhoneTrack(speech.phones.labels, ends_s)), request).animation(0.2, 0.4)
    assert len(made) == 1
    preview.change(speech, replace(request, seed=1)).animation()
    assert len(made) == 2


def test_a_window_at_the_very_end_holds_a_frame(corpus):
    model, speech, request = create("mean_face").fit(corpus), next(iter(corpus)).speech, Request(fps=25)
    now = Preview(cast_for(model, request), request).change(speech, request)
    assert len(now.animation(speech.duration_s, speech.duration_s + 5)) == 1
    assert len(now.animation(-1, 1e-9)) == 1
