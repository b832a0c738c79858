import numpy as np
import pytest
import soundfile

from facesynth.inference.errors import FacesynthError
from facesynth.inference.sound import resample as streamed_resample
from facesynth.speech import audio as audio_module
from facesynth.speech.audio import load_audio, require_sound, resample, save_wav


def tone(rate, duration_s=1.0, hz=440.0, level=0.5):
    return (level * np.sin(2 * np.pi * hz * np.arange(round(duration_s * rate)) / rate)).astype(np.float32)


def write_video(path, audio=None, rate=44100):
    import av

    with av.open(str(path), "w") as container:
        video = container.add_stream("mpeg4", rate=25)
        video.width = video.height = 64
        sound = None if audio is None else container.add_stream("aac", rate=rate, layout="mono")
        for number in range(25):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), number * 5, np.uint8), format="rgb24")
            container.mux(video.encode(frame))
        container.mux(video.encode(None))
        if sound is not None:
            frame = av.AudioFrame.from_ndarray(audio[None], format="fltp", layout="mono")
            frame.sample_rate = rate
            container.mux(sound.encode(frame))
            container.mux(sound.encode(None))


@pytest.mark.parametrize("subtype", ["PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT"])
@pytest.mark.parametrize("rate", [8000, 44100])
def test_wav_of_any_depth_gives_its_samples(tmp_path, subtype, rate):
    wanted = tone(rate)
    soundfile.write(tmp_path / "a.wav", wanted, rate, subtype=subtype)
    audio, got_rate = load_audio(tmp_path / "a.wav")
    assert got_rate == rate
    assert audio.dtype == np.float32
    np.testing.assert_allclose(audio, wanted, atol=1 / 127 if subtype == "PCM_U8" else 1e-4)


def test_stereo_becomes_the_mean_of_its_channels(tmp_path):
    left, right = tone(44100), tone(44100, hz=300)
    soundfile.write(tmp_path / "a.flac", np.stack([left, right], axis=1), 44100, subtype="PCM_24")
    audio, rate = load_audio(tmp_path / "a.flac")
    assert rate == 44100
    np.testing.assert_allclose(audio, (left + right) / 2, atol=1e-5)


def test_channels_that_cancel_are_heard_through_the_louder(tmp_path):
    soundfile.write(tmp_path / "a.wav", np.stack([0.99 * tone(16000), -tone(16000)], axis=1), 16000)
    np.testing.assert_allclose(load_audio(tmp_path / "a.wav")[0], -tone(16000), atol=1e-4)


def test_one_channel_of_eight_is_no_cancelling(tmp_path):
    channels = np.zeros((16000, 8))
    channels[:, 3] = tone(16000)
    soundfile.write(tmp_path / "a.wav", channels, 16000)
    np.testing.assert_allclose(load_audio(tmp_path / "a.wav")[0], tone(16000) / 8, atol=1e-4)


def test_six_channels(tmp_path):
    soundfile.write(tmp_path / "a.wav", np.tile(tone(16000)[:, None], 6), 16000)
    np.testing.assert_allclose(load_audio(tmp_path / "a.wav")[0], tone(16000), atol=1e-4)


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".avi", ".mov"])
def test_sound_of_a_video(tmp_path, suffix):
    path = tmp_path / f"ein Bild mit Ton Ü{suffix}"
    write_video(path, tone(44100))
    audio, rate = load_audio(path)
    assert rate == 44100
    assert len(audio) == pytest.approx(44100, abs=3000)
    spectrum = np.abs(np.fft.rfft(audio))
    assert np.argmax(spectrum) * rate / len(audio) == pytest.approx(440, abs=3)
    assert audio[5000:35000].std() == pytest.approx(0.5 / np.sqrt(2), rel=0.05)


def test_video_without_sound(tmp_path):
    write_video(tmp_path / "silent.mp4")
    with pytest.raises(FacesynthError, match="no sound in it"):
        load_audio(tmp_path / "silent.mp4")


@pytest.mark.parametrize("name", ["noise.wav", "noise.mp4", "noise.bin"])
def test_corrupt_file(tmp_path, name):
    (tmp_path / name).write_bytes(b"RIFF" + np.random.default_rng(0).bytes(4000))
    with pytest.raises(FacesynthError, match=r"cannot be read|no sound"):
        load_audio(tmp_path / name)


def test_truncated_video(tmp_path):
    write_video(tmp_path / "whole.mp4", tone(44100))
    data = (tmp_path / "whole.mp4").read_bytes()
    (tmp_path / "half.mp4").write_bytes(data[: len(data) // 2])
    with pytest.raises(FacesynthError, match="cannot be read"):
        load_audio(tmp_path / "half.mp4")


def test_no_file_no_bytes_no_samples(tmp_path):
    with pytest.raises(FacesynthError, match="no such file"):
        load_audio(tmp_path / "absent.wav")
    (tmp_path / "empty.wav").touch()
    with pytest.raises(FacesynthError, match="empty"):
        load_audio(tmp_path / "empty.wav")
    soundfile.write(tmp_path / "zero.wav", np.zeros(0), 16000)
    with pytest.raises(FacesynthError, match="0 samples"):
        load_audio(tmp_path / "zero.wav")


def test_a_folder_is_no_sound(tmp_path):
    with pytest.raises(FacesynthError, match="no such file"):
        load_audio(tmp_path)


def test_nan_samples(tmp_path):
    soundfile.write(tmp_path / "nan.wav", np.array([0.0, np.nan]), 16000, subtype="FLOAT")
    with pytest.raises(FacesynthError, match="NaN"):
        load_audio(tmp_path / "nan.wav")


def test_too_short_and_silent_sounds_are_refused():
    require_sound(tone(16000, 0.06), 16000)
    with pytest.raises(FacesynthError, match="10 ms long"):
        require_sound(tone(16000, 0.01), 16000)
    with pytest.raises(FacesynthError, match=r"silent.*-inf dB"):
        require_sound(np.zeros(16000, np.float32), 16000)
    with pytest.raises(FacesynthError, match=r"silent.*-8[0-9] dB"):
        require_sound(tone(16000, level=1e-4), 16000)
    with pytest.raises(FacesynthError, match="silent"):
        require_sound(np.full(16000, 0.3, np.float32), 16000)


@pytest.mark.parametrize(("rate", "new_rate"), [(44100, 16000), (8000, 16000), (48000, 16000), (16000, 16000)])
def test_resampling_keeps_time_and_pitch(rate, new_rate):
    wanted = tone(new_rate)
    got = resample(tone(rate), rate, new_rate)
    assert got.dtype == np.float32
    assert len(got) == len(wanted)
    np.testing.assert_allclose(got[500:-500], wanted[500:-500], atol=2e-3)


def test_resampling_lets_nothing_alias():
    assert np.abs(resample(tone(44100, hz=12000), 44100, 16000)[500:-500]).max() < 0.01


@pytest.mark.parametrize(
    ("rate", "new_rate"), [(44100, 16000), (11025, 16000), (48000, 22050), (8000, 16000), (16000, 14720), (44056, 16000)]
)
def test_resampling_is_that_of_the_streams(rate, new_rate):
    sound = np.random.default_rng(0).normal(0, 0.1, rate // 2 + 17).astype(np.float32)
    np.testing.assert_allclose(resample(sound, rate, new_rate), streamed_resample(sound, rate, new_rate), atol=2e-7)


@pytest.mark.parametrize(("rate", "new_rate"), [(44100, 16000), (11025, 48000), (16000, 22050)])
def test_blocks_leave_no_seams(monkeypatch, rate, new_rate):
    sound = np.random.default_rng(0).normal(0, 0.1, 5 * rate + 1).astype(np.float32)
    whole = resample(sound, rate, new_rate)
    monkeypatch.setattr(audio_module, "BLOCK", 20_000)
    pieces = resample(sound, rate, new_rate)
    assert len(pieces) == len(whole) == -(-len(sound) * new_rate // rate)
    np.testing.assert_allclose(pieces, whole, atol=1e-6)


@pytest.mark.parametrize(("rate", "new_rate"), [(44100, 16000), (16000, 44100), (48000, 22050)])
def test_what_passes_and_what_is_stopped(rate, new_rate):
    """Up to four fifths of half the lower rate nothing changes; from six fifths on, 50 dB are taken away."""
    half = min(rate, new_rate) / 2
    kept = resample(tone(rate, hz=0.8 * half), rate, new_rate)
    np.testing.assert_allclose(kept[500:-500], tone(new_rate, hz=0.8 * half)[500:-500], atol=2e-3)
    if new_rate < rate:
        assert np.abs(resample(tone(rate, hz=1.2 * half), rate, new_rate)[500:-500]).max() < 0.5 * 10 ** (-50 / 20)


def test_rates_with_nothing_in_common_take_no_gigabytes():
    got = resample(tone(44101), 44101, 16000)
    np.testing.assert_allclose(got[500:-500], tone(16000)[500:-500], atol=2e-3)


def test_saved_wav_is_16_bit_and_clipped(tmp_path):
    save_wav(tmp_path / "ä b" / "a.wav", np.array([0, 0.5, 2.0, -2.0], np.float32), 16000)
    assert soundfile.info(tmp_path / "ä b" / "a.wav").subtype == "PCM_16"
    np.testing.assert_allclose(load_audio(tmp_path / "ä b" / "a.wav")[0], [0, 0.5, 1, -1], atol=1e-4)
