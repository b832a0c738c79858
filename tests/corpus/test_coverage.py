import json

import pytest
from click.testing import CliRunner
from corpora import tiny_corpus

from facesynth.cli.corpus import corpus_group
from facesynth.corpus.coverage import diphones, read_sentences, sentences_to_add
from facesynth.corpus.pictures import draw
from facesynth.inference.errors import FacesynthError

SENTENCES = ("Sing a song.", "Judge the young giant.", "A song.", "Judge the young giant.")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("c") / "tiny")


def test_the_sentence_with_most_that_is_new_comes_first(corpus):
    chosen = sentences_to_add(corpus, SENTENCES, 5)
    assert [found.text for found in chosen][:2] == ["Judge the young giant.", "Sing a song."]
    assert chosen[0].new >= 12
    assert chosen[2].new <= 1
    assert len(chosen) == 3


def test_what_was_recorded_is_not_named_again(corpus):
    said = corpus.records[0].text
    assert sentences_to_add(corpus, [said]) == () or not said
    assert sum(diphones(corpus).values()) == sum(len(u.speech.phones) - 1 for u in corpus)


def test_stats_name_sentences_and_draw_recordings(corpus, tmp_path):
    lines = tmp_path / "lines.txt"
    lines.write_text("# mine\nJudge the young giant.\n\nSing a song.\n", encoding="utf-8")
    args = ["stats", str(corpus.path), "--sentences", str(lines), "--add", "1", "--pictures", str(tmp_path / "p"), "--json"]
    done = CliRunner().invoke(corpus_group, args)
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert [found["text"] for found in facts["would_add_most"]] == ["Judge the young giant."]
    assert len(facts["pictures"]) == len(corpus)
    plain = CliRunner().invoke(corpus_group, ["stats", str(corpus.path), "--add", "2"])
    assert plain.output.count("would add most") == 2


def test_a_picture_shows_the_mouth_and_marks_closed_lips(corpus, tmp_path):
    from PIL import Image

    utterance = next(u for u in corpus if {"p", "b", "m"} & set(u.speech.phones.labels))
    draw(utterance, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        colours = {colour for _, colour in image.getcolors(1 << 20)}
        assert image.width == pytest.approx(320 * utterance.speech.duration_s + 24, abs=1)
    assert {(0x2D, 0x6F, 0xC2), (0xC2, 0x45, 0x2D)} <= colours


def test_files_without_sentences_are_refused(tmp_path):
    (tmp_path / "a.txt").write_text("# nothing\n", encoding="utf-8")
    with pytest.raises(FacesynthError, match="write one a line"):
        read_sentences(tmp_path / "a.txt")
    with pytest.raises(FacesynthError, match="cannot be read"):
        read_sentences(tmp_path / "b.txt")
