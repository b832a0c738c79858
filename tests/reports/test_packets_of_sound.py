"""Sound in packets whose header states too little, whose pages are lost, or that follows another recording in one file."""

import struct

import bringing
import numpy as np
import pytest
import soundfile
from closing_clips import Clip, clicks_of, encoded_pictures, encoded_sound, largest_error_s, write

from facesynth.corpus import Corpus
from facesynth.speech.audio import load_audio, read_sound

RATE = 48000
CLICKS_S = (0.5, 2.0, 3.5, 5.0, 6.5, 8.5, 9.7)


def clicking(path, kind, subtype=None):
    """10 s of faint noise with clicks, and the bytes of its file."""
    samples = np.random.default_rng(0).normal(0, 0.01, 10 * RATE).astype(np.float32)
    for click in CLICKS_S:
        samples[round(click * RATE) :][:48] = 0.9
    soundfile.write(path, samples, RATE, format=kind, subtype=subtype)
    return bytearray(path.read_bytes())


def heard(path):
    """When clicks are heard, how long the sound is, and what is said of it."""
    sound = read_sound(path)
    return clicks_of(sound.audio, sound.sample_rate), len(sound.audio) / sound.sample_rate, sound.remarks


def pages(content):
    return [*(place for place in range(len(content)) if content[place : place + 4] == b"OggS"), len(content)]


@pytest.mark.parametrize("subtype", ["VORBIS", "OPUS"])
def test_a_lost_page_of_ogg_is_silence_and_told(tmp_path, subtype):
    path = tmp_path / "a.ogg"
    content = clicking(path, "OGG", subtype)
    np.testing.assert_allclose(heard(path)[0], CLICKS_S, atol=0.002)
    places = pages(content)
    lost = len(places) // 2
    path.write_bytes(content[: places[lost]] + content[places[lost + 1] :])
    clicks_s, duration_s, remarks = heard(path)
    assert set(np.round(clicks_s, 1)) == set(CLICKS_S) - {5.0}
    assert duration_s == pytest.approx(10, abs=0.01)
    assert remarks[0].startswith("gaps in the sound: 1,")


@pytest.mark.parametrize(("kind", "subtype"), [("OGG", "VORBIS"), ("OGG", "OPUS"), ("MP3", None)])
def test_a_recording_that_follows_in_the_same_file_is_read_too(tmp_path, kind, subtype):
    path = tmp_path / "a.ogg"
    content = clicking(path, kind, subtype)
    path.write_bytes(content + content)
    clicks_s, duration_s, remarks = heard(path)
    np.testing.assert_allclose(clicks_s, [*CLICKS_S, *(10 + click for click in CLICKS_S)], atol=0.08)
    assert duration_s == pytest.approx(20, abs=0.1)
    assert kind == "MP3" or "2 recordings one after the other" in remarks[0]


@pytest.mark.parametrize("stated", [0, 8000, 4_000_000])
def test_flac_that_states_another_length_is_read_to_its_end(tmp_path, stated):
    path = tmp_path / "a.flac"
    content = clicking(path, "FLAC")
    content[21] &= 0xF0
    struct.pack_into(">I", content, 22, stated)
    path.write_bytes(content)
    np.testing.assert_allclose(heard(path)[0], CLICKS_S, atol=0.002)
    path.write_bytes(content[: 6 * len(content) // 10])
    clicks_s, duration_s, remarks = heard(path)
    np.testing.assert_allclose(clicks_s, CLICKS_S[:4], atol=0.002)
    assert 5.5 < duration_s < 6.1
    assert "1 of 71 packets of the sound are damaged" in remarks[0]


def test_mp3_that_states_another_length_or_is_cut_off_is_read_to_its_end(tmp_path):
    """libsndfile gives as many samples as the file states, whatever lies in memory."""
    path = tmp_path / "a.mp3"
    content = clicking(path, "MP3")
    np.testing.assert_allclose(heard(path)[0], CLICKS_S, atol=0.002)
    assert heard(path)[2] == ()
    path.write_bytes(content[: 6 * len(content) // 10])
    np.testing.assert_allclose(heard(path)[0], CLICKS_S[:4], atol=0.002)
    header = max(content.find(b"Xing"), content.find(b"Info"))
    few = bytearray(content)
    struct.pack_into(">I", few, header + 8, 50)
    path.write_bytes(few)
    np.testing.assert_allclose(heard(path)[0], CLICKS_S, atol=0.002)
    content[header + 120 : header + 156] = bytes(36)  # what an encoder says of its priming
    path.write_bytes(content)
    clicks_s, _, remarks = heard(path)
    np.testing.assert_allclose(clicks_s, CLICKS_S, atol=0.002)
    assert "1105 samples were taken off" in remarks[0]


def test_two_sounds_in_a_file_are_told(tmp_path):
    import av

    path = tmp_path / "a.mkv"
    with av.open(str(path), "w") as container:
        video = container.add_stream("libx264", rate=1000)
        video.width = video.height = 64
        video.pix_fmt = "yuv420p"
        sounds = [container.add_stream("aac", rate=RATE, layout="mono") for _ in range(2)]
        for packet in encoded_pictures(video, Clip(), counting=False):
            container.mux(packet)
        for stream, clip in zip(sounds, (Clip(), Clip(())), strict=True):
            for packet in encoded_sound(stream, clip):
                container.mux(packet)
    assert largest_error_s(path) < 0.02
    assert read_sound(path).remarks == ("the file holds 2 sounds; the first of them is used",)


def test_a_sound_whose_channels_change_is_read_on(tmp_path):
    """As in a broadcast: one channel, then two."""
    import av

    parts = []
    for layout, start_s in (("mono", 0.0), ("stereo", 2.0)):
        path = tmp_path / f"{layout}.ts"
        with av.open(str(path), "w") as container:
            stream = container.add_stream("ac3", rate=RATE, layout=layout)
            samples = np.zeros((1 if layout == "mono" else 2, 2 * RATE), np.float32)
            samples[:, RATE : RATE + 48] = 0.9
            frame = av.AudioFrame.from_ndarray(samples, format="fltp", layout=layout)
            frame.rate, frame.pts = RATE, 0
            for packet in (*stream.encode(frame), *stream.encode()):
                packet.pts = packet.dts = packet.pts + round(start_s / packet.time_base)
                container.mux(packet)
        parts.append(path.read_bytes())
    (tmp_path / "a.ts").write_bytes(b"".join(parts))
    np.testing.assert_allclose(heard(tmp_path / "a.ts")[0], [1.0, 3.0], atol=0.01)


@pytest.mark.parametrize("options", [{"use_editlist": "0"}, {"movflags": "frag_keyframe+empty_moov"}])
def test_an_mp4_without_an_edit_list_does_not_say_its_priming(tmp_path, options):
    import av

    path = tmp_path / "a.m4a"
    with av.open(str(path), "w", format="mp4", options=options) as container:
        for packet in encoded_sound(container.add_stream("aac", rate=RATE, layout="mono"), Clip()):
            container.mux(packet)
    clicks_s, _, remarks = heard(path)
    np.testing.assert_allclose(clicks_s, Clip().closures_s, atol=0.002)
    assert "1024 samples were taken off" in remarks[0]


@pytest.mark.parametrize("suffix", ["mka", "m4a", "mov"])
def test_a_raw_stream_in_a_container_does_not_say_it_either(tmp_path, suffix):
    import av

    raw, path = write(tmp_path / "a.aac", codecs=("", "aac"), pictures=False), tmp_path / f"a.{suffix}"
    with av.open(str(raw)) as source, av.open(str(path), "w") as container:
        stream = container.add_stream_from_template(source.streams.audio[0])
        for packet in source.demux():
            if packet.size:
                packet.stream = stream
                container.mux(packet)
    clicks_s, _, remarks = heard(path)
    np.testing.assert_allclose(clicks_s, Clip().closures_s, atol=0.002)
    assert "1024 samples were taken off" in remarks[0]


def test_corpus_and_speak_say_so(tmp_path, talker):
    path = tmp_path / "take.opus"
    content = clicking(path, "OGG", "OPUS")
    places = pages(content)
    path.write_bytes(content[: places[7]] + content[places[8] :])
    np.savez(tmp_path / "take.npz", frames=np.full((10 * bringing.FPS, 4), 0.2, np.float32), fps=float(bringing.FPS))
    (tmp_path / "take.lab").write_text("0.5 pau\n9 aa\n10.0 pau\n", encoding="utf-8")
    corpus = bringing.corpus_of(tmp_path)
    report, account = bringing.added(corpus, path, tmp_path / "take.npz", tmp_path / "take.lab")
    assert "gaps in the sound: 1, 1.00 s in all" in report["remarks"]["take"][0]
    assert "gaps in the sound: 1, 1.00 s in all" in account
    stored = clicks_of(*load_audio(Corpus.open(corpus).files.audio("take")))
    assert set(np.round(stored, 1)) == set(CLICKS_S) - {5.0}
    _, facts = bringing.spoken(talker, path, tmp_path, "--phones", tmp_path / "take.lab")
    assert any("gaps in the sound: 1, 1.00 s in all" in remark for remark in facts["remarks"])


def test_more_than_eight_channels(tmp_path):
    """As recorders of several microphones write them."""
    import av

    path, samples = tmp_path / "a.mka", np.zeros((RATE, 16), np.int16)
    samples[RATE // 2 : RATE // 2 + 48] = 20000
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=RATE, layout="16c")
        frame = av.AudioFrame.from_ndarray(samples.reshape(1, -1), format="s16", layout="16c")
        frame.rate, frame.pts = RATE, 0
        for packet in (*stream.encode(frame), *stream.encode()):
            container.mux(packet)
    np.testing.assert_allclose(heard(path)[0], [0.5], atol=1e-4)
