import numpy as np
import pytest
from corpora import label_lines

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.audio import save_wav
from facesynth.speech.hearing import hear
from facesynth.speech.textgrid import write_textgrid

TRACK = PhoneTrack(("pau", "m", "aa", "pau"), np.array([0.2, 0.3, 0.8, 1.0]))


@pytest.fixture
def hum(tmp_path):
    """Path of one second of a hum."""
    path = tmp_path / "ein Ton.wav"
    save_wav(path, 0.3 * np.sin(np.arange(16000) / 10).astype(np.float32), 16000)
    return path


def test_phones_from_a_textgrid(hum, tmp_path):
    write_textgrid(tmp_path / "a.TextGrid", TRACK, [("ma", 0.2, 0.8)])
    heard = hear(hum, phones_path=tmp_path / "a.TextGrid", emotion="happy", intensity=0.7)
    assert heard.source == "textgrid"
    assert heard.speech.phones.labels == TRACK.labels
    assert heard.speech.text == "ma"
    assert heard.speech.emotions.labels == ("happy",)
    assert heard.speech.emotions.intensities.tolist() == [0.7]
    assert heard.warnings == ()


def test_phones_from_label_lines_are_completed_to_the_end_of_the_sound(hum, tmp_path):
    (tmp_path / "a.lab").write_text(label_lines(PhoneTrack(("m", "aa"), np.array([0.3, 0.6]))))
    heard = hear(hum, phones_path=tmp_path / "a.lab")
    assert heard.source == "labels"
    assert heard.speech.phones.labels == ("m", "aa", "pau")
    assert heard.speech.duration_s == 1.0
    assert heard.speech.emotions.labels == ("neutral",)


def test_phones_a_little_longer_than_the_sound_are_cut_much_longer_ones_refused(hum, tmp_path):
    (tmp_path / "a.lab").write_text(label_lines(PhoneTrack(("m", "aa"), np.array([0.3, 1.15]))))
    assert hear(hum, phones_path=tmp_path / "a.lab").speech.duration_s == 1.0
    (tmp_path / "b.lab").write_text(label_lines(PhoneTrack(("m", "aa"), np.array([0.3, 1.25]))))
    with pytest.raises(FacesynthError, match=r"ends at 1.25 s, the sound at 1.00 s"):
        hear(hum, phones_path=tmp_path / "b.lab")


def test_a_track_of_emotions(hum, tmp_path):
    (tmp_path / "a.lab").write_text(label_lines(TRACK))
    (tmp_path / "e.csv").write_text("end_s,emotion,intensity\n0.5,happy,1\n1,sad,0.5\n")
    emotions = hear(hum, phones_path=tmp_path / "a.lab", emotions_path=tmp_path / "e.csv").speech.emotions
    assert emotions.labels == ("happy", "sad")
    assert emotions.ends_s.tolist() == [0.5, 1.0]


def test_what_cannot_be_heard(tmp_path, hum):
    (tmp_path / "a.lab").write_text(label_lines(TRACK))
    save_wav(tmp_path / "short.wav", np.ones(160, np.float32), 16000)
    save_wav(tmp_path / "silent.wav", np.zeros(16000, np.float32), 16000)
    with pytest.raises(FacesynthError, match="10 ms"):
        hear(tmp_path / "short.wav", text="Oh")
    with pytest.raises(FacesynthError, match="give the phones of this sound"):
        hear(tmp_path / "short.wav", phones_path=tmp_path / "a.lab")
    with pytest.raises(FacesynthError, match="silent"):
        hear(tmp_path / "silent.wav", phones_path=tmp_path / "a.lab")
    with pytest.raises(FacesynthError, match="intensity"):
        hear(hum, phones_path=tmp_path / "a.lab", intensity=2.0)
    with pytest.raises(FacesynthError, match="no such"):
        hear(hum, phones_path=tmp_path / "absent.TextGrid")


def test_a_transcript_and_nothing_at_all(say, tmp_path):
    save_wav(tmp_path / "a.wav", *say("The quick brown fox jumps over the lazy dog."))
    aligned = hear(tmp_path / "a.wav", text="The quick brown fox jumps over the lazy dog")
    assert aligned.source == "transcript"
    assert len(aligned.words) == 9
    recognised = hear(tmp_path / "a.wav")
    assert recognised.source == "recognition"
    assert recognised.words == ()
    assert recognised.speech.phones.duration_s == aligned.speech.phones.duration_s
    assert any("transcript helps" in warning for warning in recognised.warnings)
    write_textgrid(tmp_path / "a.TextGrid", aligned.speech.phones, aligned.words)
    again = hear(tmp_path / "a.wav", phones_path=tmp_path / "a.TextGrid")
    assert again.speech.phones.labels == aligned.speech.phones.labels
    np.testing.assert_allclose(again.speech.phones.ends_s, aligned.speech.phones.ends_s, atol=1e-6)
