"""Transcripts that lack a paragraph of the sound, or have one too many: aligned around it, and the stretch is named."""

import re

import numpy as np
import pytest
from bringing import added, corpus_of, spoken

from facesynth.speech.audio import save_wav

PARAGRAPHS = (
    "The old boat moved up and down beside the harbour wall. Nobody had painted it for many years.",
    "My brother bought a map of the mountains before the weather changed.",
    "We waited by the window until the music stopped, and then we walked home in the rain.",
    "Please put the empty bottles back into the basket, and bring them to the shop tomorrow morning.",
    "Some people believe that summer is too short, but most of them have never seen a winter here.",
)
OTHER = "Fourteen yellow parrots shouted at the judge through a broken telephone while he was eating his lunch."


@pytest.fixture(scope="module")
def told(voice, tmp_path_factory):
    """A file of all paragraphs, when each begins, and when the last ends, seconds."""
    from facesynth.performer.voice import speak

    takes = speak(PARAGRAPHS)
    rate = takes[0][1]
    sounds = [np.pad(audio, (0, rate // 2)) for audio, _ in takes]
    path = tmp_path_factory.mktemp("told") / "told.wav"
    save_wav(path, np.concatenate(sounds), rate)
    return path, np.cumsum([0, *map(len, sounds)]) / rate


def named_s(remarks, what):
    """Times of the one remark that says so."""
    (remark,) = (remark for remark in remarks if what in remark)
    return [float(number) for number in re.findall(r"\d+\.\d", remark)]


def test_speak_goes_around_a_paragraph_that_the_transcript_lacks(told, tmp_path, talker):
    path, starts_s = told
    curves, facts = spoken(talker, path, tmp_path, "--text", " ".join(PARAGRAPHS[:2] + PARAGRAPHS[3:]))
    start_s, end_s = named_s(facts["remarks"], "something is said that the transcript lacks")
    assert start_s == pytest.approx(starts_s[2], abs=0.4)
    assert end_s == pytest.approx(starts_s[3] - 0.5, abs=0.6)
    frames = slice(round(start_s * 50), round(end_s * 50))
    assert np.ptp(curves["jawOpen"][frames]) > 0.3, "lips move to what is said there too"


def test_corpus_add_leaves_out_a_paragraph_too_many(told, tmp_path):
    path, starts_s = told
    corpus = corpus_of(tmp_path)
    motion = tmp_path / "told.npz"
    np.savez(motion, frames=np.full((round(starts_s[-1] * 50), 4), 0.2, np.float32), fps=50.0)
    text = " ".join([*PARAGRAPHS[:3], OTHER, *PARAGRAPHS[3:]])
    report, account = added(corpus, path, motion, "--text", text)
    (at_s,) = named_s(report["remarks"]["told"], "words of the transcript are not heard")
    assert at_s == pytest.approx(starts_s[3], abs=0.6)
    assert "'fourteen yellow parrots" in account
    grid = (corpus / "phones" / "told.TextGrid").read_text(encoding="utf-8")
    assert "parrots" not in grid
    assert "basket" in grid
