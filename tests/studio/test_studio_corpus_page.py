"""The page of the corpus in a real browser: what is wrong is told, transcripts are corrected, models are trained and judged."""

import json

import pytest
from browsing import Page, started
from corpora import tiny_corpus

from facesynth.corpus import Corpus
from facesynth.corpus.journal import Journal
from facesynth.methods.registry import load


def job(page, button, within_s=240):
    """Press a button that starts something, and wait until it is done."""
    done = ended(page, button, within_s)
    assert done["code"] == 0, done
    return done


def ended(page, button, within_s=240):
    """The same, however it ends."""
    before = page.see("facesynth.store.jobs.size")
    page.page.click(button)
    page.until(f"facesynth.store.jobs.size > {before}")
    page.until("[...facesynth.store.jobs.values()].at(-1).code !== null", within_s)
    return page.see("[...facesynth.store.jobs.values()].at(-1)")


def said(page, text):
    page.until(f"document.getElementById('status').textContent.includes('{text}')")


def test_a_corpus_is_checked_and_its_transcripts_are_corrected(window, shop):
    page = window()
    page.page.click("#tab-corpus")
    page.page.fill("#text-s02_neutral_t1", "wrong words")
    page.page.keyboard.press("Tab")
    said(page, "the transcript is kept")
    assert Corpus.open(shop / "actor").record("s02_neutral_t1").text == "wrong words"
    job(page, "#corpus-check")
    page.until("document.getElementById('problems') !== null")
    found = page.page.inner_text("#problems")
    assert found.count("→") == page.page.locator("#problems .problem").count() > 0
    page.page.click("#corpus-align")
    said(page, "tick the utterances")
    page.page.check('[aria-label="Choose s02_neutral_t1"]')
    aligned = ended(page, "#corpus-align")
    assert "corpus align" in aligned["command"]
    assert "--id s02_neutral_t1" in aligned["command"]
    page.until("document.getElementById('corpus-jobs').textContent.includes('given or corrected by hand')")


def test_what_was_removed_is_kept_in_the_corpus_and_markers_move(window, shop):
    page = window()
    page.load_a_line("s04_neutral_t1")
    markers_lie_on_the_face_and_have_curves(page)
    node, phone = page.see("[facesynth.store.choices[2].node, facesynth.store.choices[2].node_phone]")
    page.see(f"facesynth.map.lookAt('{phone}', '{node}')")
    page.until(f"facesynth.map.state().chosen === '{node}'")
    page.page.click("#map-where")
    page.until(f"facesynth.store.recording?.utterance === '{node.split(':')[0]}'")
    page.after(lambda: page.page.click("#map-remove"))
    page.page.click("#show-nodes")
    suspicious_ones_are_listed_without_those_that_are_removed(page, node)
    page.page.click("#keep-edits")
    said(page, "in the corpus now")
    assert node in Journal(shop / "actor" / "edits.jsonl").removed()
    page.page.click("#keep-edits")
    said(page, "has all of these edits already")
    page.after(lambda: page.page.click(f'[aria-label="Restore {node}"]'))
    assert node not in page.see("facesynth.store.project.removed")


def suspicious_ones_are_listed_without_those_that_are_removed(page, removed):
    found = [one["node"] for one in json.loads(job(page, "#find-suspects")["output"])["suspects"]]
    listed = page.page.locator('#inspector [aria-label^="Look at "]').all_inner_texts()
    assert listed == [node for node in found if node != removed]
    assert listed or "none is left" in page.page.inner_text("#inspector")


def markers_lie_on_the_face_and_have_curves(page):
    assert "chin" in page.see("facesynth.store.markers.names")
    page.page.select_option("#curve", "chin up")
    jaw, chin = page.see(
        """(() => {
          const { motion, markers } = facesynth.store, read = markers.curve("chin up", motion.names);
          const rows = Array.from({ length: motion.count }, (_, k) => k * motion.columns);
          const jaw = rows.map((start) => motion.rows[start + motion.names.indexOf("jawOpen")]);
          return [jaw, rows.map((start) => read(motion.rows, start))];
        })()"""
    )
    open_most = jaw.index(max(jaw))
    assert jaw[open_most] > 0.02
    assert chin[open_most] < 0.5  # the chin is below its place at rest where the jaw is open
    page.page.check("#markers")
    page.until("facesynth.store.markers.points.visible")


@pytest.mark.slow
def test_models_are_trained_and_judged_from_the_page(chromium, tmp_path):
    corpus = tiny_corpus(tmp_path / "actor", utterances=16, fps=60)
    with started(corpus.path, "--project", tmp_path / "work") as address:
        page = Page(chromium, address)
        page.page.click("#tab-corpus")
        page.page.select_option("#corpus-method", "phone_mean")
        job(page, "#corpus-train")
        page.until("facesynth.store.model?.method === 'phone_mean'")
        assert load(tmp_path / "work" / "models" / "phone_mean.safetensors").capabilities.name == "phone_mean"
        page.page.fill("#corpus-folds", "2")
        page.page.uncheck("#corpus-references")
        judged = job(page, "#corpus-evaluate", within_s=600)
        assert "--folds 2 --no-references" in judged["command"]
        page.until("facesynth.store.reports.length === 1")
        with page.context.expect_page() as opened:
            page.page.click("#corpus a[href^='/reports/']")
        opened.value.wait_for_load_state()
        assert "phone_mean" in opened.value.inner_text("body")
        page.context.close()
        assert page.errors == []
