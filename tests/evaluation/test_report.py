import csv
import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus, tiny_layout, tiny_utterances

from facesynth.corpus import Corpus
from facesynth.evaluation import report
from facesynth.evaluation.compare import evaluate
from facesynth.evaluation.contestants import Contestant, Family
from facesynth.evaluation.exports import escape
from facesynth.evaluation.folds import make_folds
from facesynth.evaluation.paired import tallied
from facesynth.evaluation.point_face import PointFace
from facesynth.evaluation.report import PAGE, Wish, pictured_rows, typical, write_report
from facesynth.evaluation.table import short_number
from facesynth.evaluation.verdict import verdicts
from facesynth.face.draw.video import read_video
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.methods.baselines.mean_face import MeanFace

FILES = (
    "table.csv table.md table.tex utterances.csv comparisons.csv phones.csv emotions.csv points.csv trade.csv residuals.csv "
    "confusions.csv report.json"
)
FAMILY = Family("By minutes", ("phone mean", "little"), "minutes", (9.0, 0.05))
CURVE = Family("By what it holds", ("mean face", "wrong"), curve="still faces")


class WrongFace(MeanFace):
    """A face that is held wrongly and shakes."""

    def synthesize(self, speech, *, seed=0, **options):
        motion = super().synthesize(speech)
        shaking = 6 + 2 * np.sin(np.arange(len(motion)))[:, None]
        return Motion(motion.frames + shaking, motion.fps, motion.layout)


class Knowing(MeanFace):
    """A method that tells what it learned."""

    def fit(self, corpus, *, seed=0):
        super().fit(corpus, seed=seed)
        self.facts["learned"] = {"temperature": 0.25}
        return self


TOYS = {"wrong_face": WrongFace, "knowing": Knowing}
"""Methods that only these tests know; see `toy_methods`."""


METHODS = (
    Contestant("phone mean", "phone_mean"),
    Contestant("little", "phone_mean", minutes=0.05),
    Contestant("mean face", "mean_face"),
    Contestant("wrong", "wrong_face"),
)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=12, fps=30)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="module")
def result(corpus, folder):
    return evaluate(METHODS, corpus, make_folds(corpus, 2), folder)


@pytest.fixture(scope="module")
def page(corpus, folder, result):
    return write_report(folder, result, corpus, [FAMILY, CURVE], Wish("Tiny & <small>", corpus.ids[:1])).read_text(
        encoding="utf-8"
    )


def test_the_page_needs_nothing_but_itself(page):
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert sources
    assert all(source.startswith(("data:", "#")) for source in sources)
    assert "default-src 'none'" in page
    assert "<script" not in page
    assert "Tiny &amp; &lt;small&gt;" in page


def test_every_part_is_there(page):
    parts = "main mean-face apart trade families shown face residuals confusions phones emotions all made"
    for part in parts.split():
        assert f'id="{part}"' in page
    assert page.count("data:video/mp4;base64,") == 1
    assert page.count("data:image/svg+xml;base64,") >= 5


def test_variants_of_one_method_are_one_curve(folder, page):
    rows = list(csv.DictReader(io.StringIO((folder / "trade.csv").read_text())))
    assert {row["curve"] for row in rows} == {"second take", "phone mean", "little", "still faces"}
    assert {row["setting"] for row in rows if row["curve"] == "still faces"} == {"mean face", "wrong"}
    nearest = [row for row in rows if row["curve"] == "still faces" and row["lve_nearest"] == "yes"]
    assert nearest[0]["setting"] == "mean face"
    assert float(nearest[0]["lve"]) == min(float(row["lve"]) for row in rows if row["curve"] == "still faces")
    assert "least lve at energy 0.9 to 1.1" in page


def test_many_rows_are_counted_and_only_the_first_of_each_family_is_drawn(result, corpus, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "MOST_IN_WORDS", 3)
    assert pictured_rows(result.comparison, [FAMILY]) == ["second take", "mean face", "wrong"]
    assert pictured_rows(result.comparison, [FAMILY, CURVE]) == ["second take", "phone mean", "mean face"]
    text = write_report(tmp_path, result, corpus, [FAMILY], Wish("Tiny", videos=False)).read_text(encoding="utf-8")
    assert "<summary>In words</summary>" in text
    assert "pictures leave 2 variants out" in text
    assert "Better by both marker_error and lve" in text
    counts = tallied(result.differences)
    for figure in {one.figure for one in result.differences}:
        won, lost = (sum(of.get(figure, (0, 0))[k] for of in counts.values()) for k in (0, 1))
        assert won == lost == sum(one.distinguishable for one in result.differences if one.figure == figure)


def test_a_method_that_loses_to_the_mean_face_is_named_with_the_reason(result, page):
    said = {one.label: one for one in verdicts(result)}
    assert said["phone mean"].good
    assert not said["wrong"].good
    assert "MORE than the mean face" in said["wrong"].text
    assert "is no nearer to the recording than the mean of all recordings" in said["wrong"].text
    assert "next to nothing of that movement follows the recorded one" in said["wrong"].text
    assert "NOT better than the mean face" in page


def test_a_verdict_compares_the_utterances_that_both_have(result):
    """Of the two utterances on which the mean face is nearest, phone mean is judged; its mean would look good elsewhere."""
    rows = {row.label: row for row in result.comparison.rows}
    order = np.argsort(rows["mean face"].values["lve"])
    partly = [rows["phone mean"].values["lve"][i] if i in order[:2] else np.nan for i in range(len(order))]
    row = replace(rows["phone mean"], values={**rows["phone mean"].values, "lve": partly})
    comparison = replace(result.comparison, rows=(rows["mean face"], row))
    said = {one.label: one for one in verdicts(replace(result, comparison=comparison))}["phone mean"]
    still = np.mean([rows["mean face"].values["lve"][i] for i in order[:2]])
    assert f"the mean face's {short_number(still)} (" in said.text
    assert f", on 2 of {len(order)} utterances)" in said.text


def test_rows_made_by_different_versions_are_named_under_the_table(corpus, result, tmp_path, page):
    assert "versions of facesynth" not in page
    accounts = {label: [{**one, "versions": {**one["versions"]}} for one in made] for label, made in result.accounts.items()}
    accounts["little"][0]["versions"]["source"] = "0" * 64
    text = write_report(tmp_path, replace(result, accounts=accounts), corpus, [], Wish("Tiny", videos=False)).read_text()
    for where in (text, (tmp_path / "table.md").read_text()):
        assert "The rows were made by 2 versions of facesynth" in where


def test_what_was_learned_is_kept_and_shown(corpus, tmp_path):
    result = evaluate((Contestant("knowing", "knowing"),), corpus, make_folds(corpus, 2), tmp_path)
    assert [one["learned"] for one in result.accounts["knowing"]] == [{"temperature": 0.25}] * 2
    text = write_report(tmp_path, result, corpus, [], Wish("Knowing", videos=False)).read_text()
    assert 'learned {"temperature": 0.25}' in text


def test_what_it_was_made_from_is_said(page, corpus):
    assert corpus.provenance()["sha256"] in page
    assert "numpy" in page
    assert "torch" in page


def test_the_same_figures_as_files(folder, result, page):
    assert all((folder / name).stat().st_size > 0 for name in FILES.split())
    whole = json.loads((folder / "report.json").read_text(), parse_constant=pytest.fail)
    assert whole["families"][0]["labels"] == ["phone mean", "little"]
    assert whole["folds"][0]["test"]
    assert whole["made_of"]["little"][0]["train_minutes"] < whole["made_of"]["phone mean"][0]["train_minutes"]
    lines = list(csv.DictReader(io.StringIO((folder / "utterances.csv").read_text())))
    assert len(lines) == 5 * len(result.comparison.utterances)
    shares = list(csv.DictReader(io.StringIO((folder / "residuals.csv").read_text())))
    assert sum(float(line["share"]) for line in shares if line["method"] == "little") == pytest.approx(1)
    asked = list(csv.DictReader(io.StringIO((folder / "confusions.csv").read_text())))
    counted = {
        label: sum(int(line["utterances"]) for line in asked if line["method"] == label) for label in ("recorded", "little")
    }
    assert counted == dict.fromkeys(counted, len(result.comparison.utterances))
    mean = np.mean([float(line["lve"]) for line in lines if line["method"] == "little"])
    assert mean == pytest.approx(result.comparison.scores["little"]["lve"].mean, rel=1e-6)


def test_the_latex_table_balances_and_escapes(folder, result):
    text = (folder / "table.tex").read_text()
    for one in text.split(r"\begin{tabular}")[1:]:
        body = [line for line in one.splitlines() if line.endswith(r"\\")]
        assert len({line.count("&") for line in body}) == 1
    assert len(body) == 1 + len(result.comparison.rows)
    assert r"lip\_gap\_corr" in text
    assert text.count("{") == text.count("}")
    assert escape(r"50 % of \a_b & c{") == r"50 \% of \textbackslash{}a\_b \& c\{"


def test_the_same_result_gives_the_same_page(corpus, folder, result, page, tmp_path):
    write_report(tmp_path, result, corpus, [FAMILY, CURVE], Wish("Tiny & <small>", corpus.ids[:1]))
    assert (tmp_path / PAGE).read_text(encoding="utf-8") == page


def test_chosen_utterances_are_shown_and_the_video_plays(corpus, result, page, tmp_path):
    import base64

    chosen = corpus.ids[0]
    assert f"<h3>{chosen}" in page
    video = re.search(r"data:video/mp4;base64,([^\"]*)", page)[1]
    (tmp_path / "v.mp4").write_bytes(base64.b64decode(video))
    read = read_video(tmp_path / "v.mp4")
    assert len(read.frames) == round(corpus[chosen].motion.duration_s * 25)
    assert len(read.audio)
    assert np.ptp(read.frames[0].astype(int)) > 100
    assert typical(result)[0] in result.comparison.utterances


def test_curves_have_a_page_too(tmp_path):
    names = ("jawOpen", "mouthClose", "mouthPucker", "browInnerUp")
    layout = Layout("curves", names, {"mouth": (0, 1, 2)})
    corpus = Corpus.create(
        tmp_path / "c", performer="Curves", layout=layout, fps=30, emotions=("neutral", "happy", "angry", "sad")
    )
    column = tiny_layout().names.index("lip_lower") * 3 + 1
    for record, speech, motion in tiny_utterances(6, 30):
        opening = np.clip((-51 - motion.frames[:, column]) / 15, 0, 1)
        frames = np.stack([opening, 0.2 * opening, 0.5 - 0.5 * opening, 0.1 + 0 * opening], axis=1)
        corpus.add_utterance(record, speech, Motion(frames, 30, layout))
    result = evaluate(METHODS[::2], corpus, make_folds(corpus, 2), tmp_path / "r")
    page = write_report(tmp_path / "r", result, corpus, [], Wish("Curves")).read_text()
    assert "weight" in page
    assert page.count("data:video/mp4") == 2


def test_a_picture_reddens_where_it_is_wrong():
    layout = tiny_layout()
    rest = np.array(layout.neutral)
    face = PointFace.of(layout, rest[None])
    plain = face.picture(rest, (120, 140)).astype(int)
    wrong = face.picture(rest, (120, 140), np.full(len(layout.names), 3.0), 3.0).astype(int)
    assert (plain[..., 0] - plain[..., 2]).max() < 60
    assert (wrong[..., 0] - wrong[..., 2]).max() > 100
    assert np.array_equal(plain, face.picture(rest, (120, 140), np.zeros(len(layout.names)), 3.0))
