import csv
import io

import numpy as np
import pytest
from corpora import tiny_corpus
from living_eyes import with_eyes
from nodding import nodding_corpus

from facesynth.config import load_config
from facesynth.corpus import Corpus, Record
from facesynth.evaluation.papers import Material, deng2006_speech, reproduce, saisan2004, saisan2004_checks
from facesynth.evaluation.papers.deng2006_eyes import EYES
from facesynth.evaluation.papers.deng2006_head import HEAD
from facesynth.evaluation.papers.deng2006_speech import DEGREES, SPEECH
from facesynth.evaluation.papers.finding import Finding, Reproduction, not_available
from facesynth.evaluation.papers.joined import joined, phones_until
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.coarticulation.method import Coarticulation
from facesynth.methods.coarticulation.transitions import PENALTIES
from facesynth.methods.efase import tuning
from facesynth.methods.efase.method import Efase
from facesynth.methods.lds.method import LDS


@pytest.mark.parametrize(
    ("file", "method", "published"),
    [
        ("efase_published", Efase, tuning.PUBLISHED),
        ("coarticulation_paper", Coarticulation, deng2006_speech.PUBLISHED),
        ("lds_paper", LDS, saisan2004.SETTINGS),
    ],
)
def test_published_settings_are_those_of_the_files(file, method, published, repository):
    written = load_config(repository / "configs" / f"{file}.yaml")
    assert method.from_config(published).config == method.from_config(written).config


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=21, fps=30)


def by_what(result, start):
    return [one for one in result.findings if one.what.startswith(start)]


def measured(figures, material):
    return [one for figure in figures for one in figure.findings(material)]


def test_deng_2008_prints_the_paper_s_figure_ours_and_that_they_cannot_be_compared(corpus):
    result = reproduce("deng2008", corpus, test_limit=3)
    times = by_what(result, "synthesis of 14 / 24 / 53 / 63 phones")[0]
    assert times.paper == "221 / 333 / 816 / 943"
    assert len(times.ours.split(" / ")) == 4
    assert not times.comparable
    assert "hardware" in times.why
    maps = by_what(result, "residual variance of")[0]
    assert all(0 <= float(rest) <= 1 for rest in maps.ours.split(" / "))
    assert by_what(result, "variance in 25")[0].paper == "98.53 %"
    drawn = {one.where for one in result.findings if one.figure}
    assert {"§3", "table 5", "fig. 10", "figs 15, 16", "figs 5 to 9"} <= drawn


def test_saisan_2004_compares_with_the_mean_pose(corpus):
    result = reproduce("saisan2004", corpus, test_limit=3)
    errors = {one.what.split(", ", 1)[1]: float(one.ours) for one in by_what(result, "RMS error")}
    assert len(errors) == 5
    assert all(error > 0 for error in errors.values())
    assert {one.where for one in result.findings if one.figure} == {"fig. 1", "fig. 3"}
    assert [one.where for one in result.findings if one.comparable] == [*4 * ["§3"], "§4"]
    passed, of = by_what(result, "residuals that pass for white")[0].ours.split(" of ")
    assert 0 <= int(passed) <= int(of)
    half = by_what(result, "half of a recording")
    assert [one.status for one in half] == ["not available"]
    assert "a half of it must have 200" in half[0].why


def test_half_of_a_recording_teaches_what_the_other_half_is_driven_by(tmp_path):
    corpus = tiny_corpus(tmp_path / "one", utterances=12, fps=60)
    frames = np.concatenate([u.motion.frames for u in corpus])
    audio = np.concatenate([u.speech.audio[: round(len(u.motion) / 60 * u.speech.sample_rate)] for u in corpus])
    seconds = len(frames) / 60
    track = EmotionTrack.constant("neutral", seconds)
    speech = Speech(audio, corpus[corpus.ids[0]].speech.sample_rate, PhoneTrack(("pau",), np.array([seconds])), track)
    long = Corpus.create(tmp_path / "long", performer="x", layout=corpus.layout, fps=60, emotions=corpus.emotions)
    long.add_utterance(Record("long"), speech, Motion(frames, 60, corpus.layout))
    found = saisan2004_checks.halves(Material(long, long, long, 0), {**saisan2004.SETTINGS, "components": 4})
    assert [one.what.rsplit(": ", 1)[1] for one in found] == ["mean pose", "deterministic part", "one sample"]
    assert all(float(one.ours) > 0 for one in found)


def test_cao_2005_says_what_a_corpus_without_emotions_cannot_give(corpus):
    neutral = corpus.subset(r.id for r in corpus.records if r.emotion == "neutral")
    result = reproduce("cao2005", neutral, test_limit=2)
    assert by_what(result, "emotions recognised")[0].status == "not available"
    assert by_what(result, "emotion map")[0].status == "not available"
    assert "single emotion" in result.markdown()


def test_speech_as_long_as_a_paper_s_says_the_same_phones(corpus):
    said = [utterance.speech for utterance in corpus.subset(corpus.ids[:3])]
    whole = sum(len(speech.phones) for speech in said)
    long = joined(said, whole + 2)
    assert long.phones.labels == (*(label for speech in said for label in speech.phones.labels), *said[0].phones.labels[:2])
    assert len(long.audio) == round(long.phones.duration_s * long.sample_rate)
    lasted = sum(speech.phones.duration_s for speech in said)
    assert long.phones.ends_s[whole - 1] == pytest.approx(lasted)
    assert long.emotions.per_phone(long.phones)[0][0] == said[0].emotions.labels[0]
    first = said[0].phones
    assert phones_until(said, first.duration_s + 1e-9) == len(first) + 1
    assert phones_until(said, first.ends_s[2] + 1e-9) == 3
    assert phones_until(said, 10 * lasted) > 9 * whole
    with pytest.raises(FacesynthError, match="sample rate"):
        joined([], 3)


@pytest.mark.parametrize("paper", ["cao2005", "deng2006"])
def test_the_others_run(corpus, paper):
    result = reproduce(paper, corpus, test_limit=3)
    assert any(one.status == "measured" for one in result.findings)


def test_the_dissertations_speech_is_measured_and_drawn(corpus):
    sentences = sorted({r.sentence for r in corpus.records if r.emotion == "neutral"})
    material = Material(corpus, corpus, corpus.subset(r.id for r in corpus.records if r.sentence == sentences[0]), 0)
    degree, place, speed, space = measured(SPEECH, material)
    assert len(degree.ours.split(" / ")) == len(PENALTIES)
    assert degree.ours.split(" / ")[0] == str(max(DEGREES))
    assert degree.figure.startswith("data:image/")
    assert place.figure.startswith("data:image/")
    assert float(place.ours) > 0.5
    assert speed.where == "fig. 5.18"
    assert 0 < float(space.ours.rstrip("%")) <= 100
    neutral = corpus.subset(r.id for r in corpus.records if r.emotion == "neutral")
    assert "in neutral alone" in SPEECH[-1].findings(Material(neutral, neutral, neutral, 0))[0].why


def test_the_dissertations_eyes_are_measured_and_drawn(tmp_path):
    corpus = with_eyes(tiny_corpus(tmp_path / "eyes", utterances=12, fps=60))
    grown, covered, bend, stuck, frames, ratings = measured(EYES, Material(corpus, corpus, corpus, 0))
    assert (covered.where, bend.where, stuck.where, ratings.where) == ("fig. 3.6", "§3.4", "§3.3", "fig. 3.8")
    assert grown.figure.startswith("data:image/")
    assert all(0 <= float(apart) <= 1 for apart in grown.ours.split(" / "))
    assert frames.status == "not available"
    assert covered.figure.startswith("data:image/")
    assert 0 <= float(covered.ours.rstrip("%")) <= float(bend.ours.split()[-1].rstrip("%")) <= 100
    assert ratings.status == "not available"
    few = corpus.subset(corpus.ids[:1])
    refused = measured(EYES, Material(few, few, few, 0))
    assert {one.status for one in refused} == {"not available"}
    assert "at least 10 s" in refused[0].why


def test_the_dissertations_heads_are_refused_where_nobody_recorded_one(tmp_path):
    corpus = nodding_corpus(tmp_path / "headless", 3, heads=0)
    headless = [HEAD[k].findings(Material(corpus, corpus, corpus, 0))[0] for k in (0, 1, 3, 4)]
    assert {one.status for one in headless} == {"not available"}
    assert all("head pose" in one.why for one in headless)


def test_the_dissertations_heads_through_key_poses_are_measured_and_drawn(tmp_path):
    corpus = nodding_corpus(tmp_path / "nods", 6)
    (off,) = HEAD[1].findings(Material(corpus, corpus.subset(corpus.ids[:4]), corpus.subset(corpus.ids[4:]), 0))
    assert off.where == "fig. 4.6"
    assert off.figure.startswith("data:image/")
    assert 0 < float(off.ours.split(" / ")[0]) < 45


def test_a_page_shows_every_figure_and_its_picture_and_files_hold_no_pictures():
    rows = (
        Finding("fig. 1", "a <curve>", "3", "4", False, "other", figure="data:image/png;base64,AAAA"),
        not_available("fig. 2", "maps", "x", "missing"),
    )
    result = Reproduction("p", "P 2000", "Ours: nothing.", rows)
    page = result.page()
    assert 'src="data:image/png;base64,AAAA"' in page
    assert "a &lt;curve&gt;" in page
    assert "not available here: missing" in page
    assert "base64" not in result.csv() + str(result.to_dict())


def test_an_unknown_paper_is_answered_with_the_nearest(corpus):
    with pytest.raises(FacesynthError, match="deng2008"):
        reproduce("deng2009", corpus)


def test_what_is_missing_has_its_place_and_files_hold_all():
    rows = (
        Finding("table 1", "seconds", "2", "1", False, "other hardware"),
        not_available("fig. 2", "maps", "a picture", "missing"),
    )
    result = Reproduction("p", "P 2000", "Ours: nothing.", rows)
    assert "| table 1 | seconds | 2 | 1 | no: other hardware |" in result.markdown()
    assert "- fig. 2, maps (paper: a picture): missing" in result.markdown()
    lines = list(csv.DictReader(io.StringIO(result.csv())))
    assert [line["status"] for line in lines] == ["measured", "not available"]
