"""WAV of a recorder that was stopped short: the size of the sound was never written, or is far too small."""

import struct

import bringing
import numpy as np
import pytest
import soundfile

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.wav import find_samples, read_wav
from facesynth.speech.audio import load_audio, read_sound

RATE = 16000
SOUND = bringing.hum(2.0)


def crashed(path, stated, subtype="PCM_16", channels=1, riff=None):
    """A WAV whose header states so many bytes of sound."""
    soundfile.write(path, np.repeat(SOUND[:, None], channels, axis=1), RATE, subtype=subtype)
    content = bytearray(path.read_bytes())
    struct.pack_into("<I", content, content.index(b"data") + 4, stated)
    struct.pack_into("<I", content, 4, len(content) - 8 if riff is None else riff)
    path.write_bytes(content)
    return path


BYTES = {"PCM_16": 2, "PCM_24": 3, "FLOAT": 4, "PCM_U8": 1}
CRASHED = [
    (stated, subtype, channels)
    for subtype, channels in (("PCM_16", 1), ("PCM_16", 2), ("PCM_24", 2), ("FLOAT", 1), ("PCM_U8", 1))
    for stated in (0, 1000, 1001, 64000)
    if stated < len(SOUND) * channels * BYTES[subtype]  # else it is what is there
]


@pytest.mark.parametrize(("stated", "subtype", "channels"), CRASHED)
@pytest.mark.parametrize("riff", [None, 0, 36])
def test_the_sound_is_read_to_the_end_and_told(tmp_path, stated, subtype, channels, riff):
    whole = len(SOUND) * channels * BYTES[subtype]
    sound = read_sound(crashed(tmp_path / "a.wav", stated, subtype, channels, riff))
    np.testing.assert_allclose(sound.audio, SOUND, atol=1 / 127 if subtype == "PCM_U8" else 1e-4)
    (remark,) = sound.remarks
    assert f"states {stated} bytes of sound" in remark
    assert f"all {whole} to the end of the file were read" in remark


@pytest.mark.parametrize("stated", [0xFFFFFFFF, 0x7FFFFFFF, 70000])
def test_a_size_that_is_too_large_is_told(tmp_path, stated):
    sound = read_sound(crashed(tmp_path / "a.wav", stated))
    np.testing.assert_allclose(sound.audio, SOUND, atol=1e-4)
    assert f"the header states {stated} bytes of sound, 64000 are there" in sound.remarks[0]


@pytest.mark.parametrize(("in_data", "in_ds64"), [(0xFFFFFFFF, 0), (0xFFFFFFFF, 4000), (0, 0), (1000, 0), (0xFFFFFFFF, 1 << 40)])
@pytest.mark.parametrize("kind", [b"RF64", b"BW64"])
def test_long_files_of_recorders_state_their_size_elsewhere(tmp_path, in_data, in_ds64, kind):
    path = tmp_path / "a.wav"
    soundfile.write(path, SOUND, RATE, format="RF64", subtype="PCM_16")
    content = bytearray(path.read_bytes())
    content[:4] = kind
    path.write_bytes(content)
    assert read_sound(path).remarks == ()
    struct.pack_into("<QQQ", content, content.index(b"ds64") + 8, 0, in_ds64, 0)
    struct.pack_into("<I", content, content.index(b"data") + 4, in_data)
    path.write_bytes(content)
    sound = read_sound(path)
    np.testing.assert_allclose(sound.audio, SOUND, atol=1e-4)
    stated = in_ds64 if in_data == 0xFFFFFFFF else in_data
    assert f"the header states {stated} bytes of sound" in sound.remarks[0]


@pytest.mark.parametrize("stated", [0, 1000, 60000])
@pytest.mark.parametrize("kind", ["RIFX", "CAF", "W64"])
def test_other_kinds_of_a_recorders_files_are_read_to_the_end_and_told(tmp_path, kind, stated):
    path = tmp_path / "a.wav"
    soundfile.write(
        path, SOUND, RATE, subtype="PCM_16", format=kind.replace("RIFX", "WAV"), endian="BIG" if kind == "RIFX" else "FILE"
    )
    assert read_sound(path).remarks == ()
    content = bytearray(path.read_bytes())
    form, behind, more = {"RIFX": (">I", 4, 0), "CAF": (">q", 4, 4), "W64": ("<Q", 16, 24)}[kind]
    struct.pack_into(form, content, content.index(b"data") + behind, stated + more)
    path.write_bytes(content)
    sound = read_sound(path)
    np.testing.assert_allclose(sound.audio, SOUND, atol=1e-4)
    assert sound.remarks[0].startswith(f"the header states {stated} bytes of sound")


def test_parts_after_the_sound_are_no_sound(tmp_path):
    path = tmp_path / "a.wav"
    soundfile.write(path, SOUND, RATE)
    title = b"LIST" + struct.pack("<I", 26) + b"INFOINAM" + struct.pack("<I", 14) + b"a fine take \0\0"
    for end in (title, title + b"id3 " + struct.pack("<I", 4) + b"abcd", b"\0"):
        path.write_bytes(path.read_bytes()[: 44 + 64000] + end)
        sound = read_sound(path)
        assert len(sound.audio) == len(SOUND)
        assert sound.remarks == ()
    soundfile.write(path, SOUND, RATE)
    content = bytearray(path.read_bytes()[: 44 + 64000])
    struct.pack_into("<I", content, 40, 0)  # never written, but the title behind the sound is there
    path.write_bytes(content + b"iXML" + struct.pack("<I", 40) + bytes(40) + title)
    sound = read_sound(path)
    assert (len(sound.audio), "states 0 bytes of sound" in sound.remarks[0]) == (len(SOUND), True)
    soundfile.write(path, SOUND[:-1], RATE, subtype="PCM_U8")
    whole = path.read_bytes()[: 44 + len(SOUND) - 1]
    for end in (title, b"\0" + title, bytes(3000)):  # a missing byte that makes the size even, and a disk's block filled up
        path.write_bytes(whole + end)
        sound = read_sound(path)
        assert (len(sound.audio), sound.remarks) == (len(SOUND) - 1, ())
    soundfile.write(path, SOUND, RATE, format="CAF")
    path.write_bytes(path.read_bytes() + b"info" + struct.pack(">q", 4) + b"abcd")
    assert (len(read_sound(path).audio), read_sound(path).remarks) == (len(SOUND), ())


def test_the_runtime_reads_it_too(tmp_path):
    for stated in (0, 500):
        path = crashed(tmp_path / "a.wav", stated)
        with pytest.warns(UserWarning, match="all 64000 to the end of the file were read"):
            audio, rate = read_wav(path)
        assert rate == RATE
        np.testing.assert_allclose(audio, SOUND, atol=1e-4)


def test_damaged_headers_find_samples_inside_the_file():
    rng = np.random.default_rng(0)
    whole = b"RIFF" + struct.pack("<I", 136) + b"WAVEfmt " + struct.pack("<IHHIIHH", 16, 1, 1, RATE, 2 * RATE, 2, 16)
    whole += b"data" + struct.pack("<I", 100) + bytes(100)
    for _ in range(2000):
        hurt = bytearray(whole[: rng.integers(12, len(whole) + 1)])
        hurt[rng.integers(len(hurt))] = rng.integers(256)
        found = find_samples(bytes(hurt))
        assert found is None or 0 <= found.start <= max(found.stop, found.start) <= max(len(hurt), found.start)


def test_corpus_and_speak_say_so(tmp_path, talker):
    path = crashed(tmp_path / "take.wav", 0)
    np.savez(tmp_path / "take.npz", frames=np.full((2 * bringing.FPS, 4), 0.2, np.float32), fps=float(bringing.FPS))
    (tmp_path / "take.lab").write_text("0.5 pau\n1.3 aa\n2.0 pau\n", encoding="utf-8")
    corpus = bringing.corpus_of(tmp_path)
    report, account = bringing.added(corpus, path, tmp_path / "take.npz", tmp_path / "take.lab")
    assert "all 64000 to the end" in report["remarks"]["take"][0]
    assert "all 64000 to the end" in account
    own = Corpus.open(corpus).files.audio("take")
    assert len(load_audio(own)[0]) == len(SOUND)
    crashed(own, 0)
    (problem,) = [problem for problem in bringing.checked(corpus) if problem["file"] == "audio/take.wav"]
    assert "all 64000 to the end" in problem["what"]
    _, facts = bringing.spoken(talker, path, tmp_path, "--phones", tmp_path / "take.lab")
    assert any("all 64000 to the end" in remark for remark in facts["remarks"])


def big_endian(path, stated, kind, subtype, channels=1):
    """An AIFF or AU whose header states so many bytes of sound."""
    soundfile.write(path, np.repeat(SOUND[:, None], channels, axis=1), RATE, format=kind, subtype=subtype)
    content = bytearray(path.read_bytes())
    if kind == "AU":
        struct.pack_into(">I", content, 8, stated)
    else:
        struct.pack_into(">I", content, content.index(b"SSND") + 4, stated + 8 if stated else 0)
        struct.pack_into(">I", content, content.index(b"COMM") + 10, stated // (channels * BYTES[subtype]))
        struct.pack_into(">I", content, 4, 0)
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("stated", [0, 1000])
@pytest.mark.parametrize(("subtype", "channels"), [("PCM_16", 1), ("PCM_24", 2)])
@pytest.mark.parametrize("kind", ["AIFF", "AU"])
def test_aiff_and_au_are_read_to_the_end_and_told(tmp_path, kind, subtype, channels, stated):
    whole = len(SOUND) * channels * BYTES[subtype]
    sound = read_sound(big_endian(tmp_path / "a.aif", stated, kind, subtype, channels))
    np.testing.assert_allclose(sound.audio, SOUND, atol=1e-4)
    (remark,) = sound.remarks
    assert f"all {whole} to the end of the file were read" in remark


@pytest.mark.parametrize("kind", ["AIFF", "AU"])
def test_aiff_and_au_that_are_whole_are_read_as_they_are(tmp_path, kind):
    path = tmp_path / "a.aif"
    soundfile.write(path, SOUND, RATE, format=kind, subtype="PCM_16")
    assert read_sound(path).remarks == ()
    if kind == "AIFF":  # a title behind the sound
        content = bytearray(path.read_bytes()) + b"NAME" + struct.pack(">I", 4) + b"take"
        struct.pack_into(">I", content, 4, len(content) - 8)
        path.write_bytes(content)
        sound = read_sound(path)
        assert (len(sound.audio), sound.remarks) == (len(SOUND), ())


def damaged(rng, content):
    """A file cut off, with a number or some bytes of its header changed, or with bytes put in."""
    kind = rng.integers(4)
    if kind == 0:
        return content[: rng.integers(4, len(content))]
    changed = bytearray(content)
    if kind == 1:
        number = int(rng.choice([0, 1, 0x7FFFFFFF, 0xFFFFFFFF, rng.integers(1 << 16), rng.integers(1 << 32)]))
        struct.pack_into(">I", changed, 4 * int(rng.integers(16)), number)
    elif kind == 2:
        for place in rng.integers(4, 80, 5):
            changed[place] = rng.integers(256)
    else:
        changed[80:80] = rng.bytes(int(rng.integers(200)))
    return bytes(changed)


@pytest.mark.parametrize("trials", [20, pytest.param(2000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["AIFF", "AU", "CAF", "W64", "FLAC", "OGG", "MP3"])
def test_damaged_sounds_end_in_sound_or_one_line(tmp_path, capfd, kind, trials):
    rng, path = np.random.default_rng(18), tmp_path / "a.aif"
    soundfile.write(path, SOUND[:8000], RATE, format=kind)
    whole = path.read_bytes()
    for _ in range(trials):
        path.write_bytes(damaged(rng, whole))
        try:
            assert len(read_sound(path).audio)
        except FacesynthError as error:
            assert "\n" not in str(error)
    assert "Traceback" not in capfd.readouterr().err
