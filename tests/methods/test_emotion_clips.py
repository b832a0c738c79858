import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.inference.errors import FacesynthError
from facesynth.methods.emotion.clips import clips_of_corpus, clips_of_list
from facesynth.methods.emotion.detector import DetectorSettings
from facesynth.speech.audio import save_wav


def test_a_corpus_gives_its_sound(tmp_path):
    clips = clips_of_corpus(tiny_corpus(tmp_path / "corpus", utterances=3))
    assert {c.emotion for c in clips} == {"neutral", "happy"}
    assert {c.speaker for c in clips} == {"Tiny"}
    assert {c.sentence for c in clips} == {"s00"}


def test_a_list_names_sound_files_beside_it(tmp_path):
    save_wav(tmp_path / "a b.wav", np.sin(np.arange(800)).astype(np.float32) / 2, 8000)
    (tmp_path / "list.csv").write_text("file,emotion,speaker\na b.wav,glad,me\n")
    (clip,) = clips_of_list(tmp_path / "list.csv")
    assert (clip.rate, clip.emotion, clip.speaker, clip.sentence, len(clip.audio)) == (8000, "glad", "me", "", 800)


@pytest.mark.parametrize(
    ("text", "message"), [("file,mood\n", "column"), ("file,emotion\n", "wanted lines"), ("", "wanted lines")]
)
def test_bad_lists_are_one_clear_line(tmp_path, text, message):
    (tmp_path / "list.csv").write_text(text)
    with pytest.raises(FacesynthError, match=message):
        clips_of_list(tmp_path / "list.csv")


def test_missing_lists_and_unknown_settings_are_refused(tmp_path):
    with pytest.raises(FacesynthError, match="cannot be read"):
        clips_of_list(tmp_path / "none.csv")
    with pytest.raises(FacesynthError, match="did you mean kernel"):
        DetectorSettings.from_config({"kernle": "linear"})
