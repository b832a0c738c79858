import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner
from clips import write_video
from interrupted import contents, killed_and_repeated

from facesynth.capture.kept_tracks import kept_track
from facesynth.capture.landmarks import landmark_layout
from facesynth.capture.shape import neutral_shape
from facesynth.cli.corpus import corpus_group
from facesynth.corpus import Corpus
from facesynth.corpus.add.add import add
from facesynth.corpus.add.recordings import find_recordings
from facesynth.corpus.add.transcripts import read_transcripts
from facesynth.corpus.importers.recorder import cut_for
from facesynth.corpus.importers.video import corpus_from_video, motion_from_video
from facesynth.corpus.workers import Workers
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import lip_gap
from facesynth.speech.audio import load_audio, save_wav

LINES = {"bgbsza": "bin green by s zero again", "lrbi7p": "lay red by i seven please", "swbm3n": "set white by m three now"}


@pytest.fixture
def clips(recordings, landmark_models, tmp_path):
    """Three clips of a real talker with what is said in them, and a file that is no video."""
    folder = tmp_path / "clips"
    folder.mkdir()
    for name in LINES:
        shutil.copy(recordings("grid_s26") / f"{name}.mpg", folder)
    (folder / "broken.mp4").write_bytes(b"no video")
    rows = [f"{name}.mpg,{text}" for name, text in LINES.items()]
    (folder / "lines.csv").write_text("\n".join(["file,text", *rows]) + "\n", encoding="utf-8")
    return folder


def videos(clips):
    return sorted(map(str, clips.glob("*.mp*g*")))


def run(*arguments):
    result = CliRunner().invoke(corpus_group, list(map(str, arguments)))
    if isinstance(result.exception, FacesynthError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def test_clips_become_a_corpus_in_one_command(clips, tmp_path):
    folder = tmp_path / "Actor 26"
    out = run("add", folder, *videos(clips), clips / "broken.mp4", "--text-file", clips / "lines.csv", "--jobs", 1, "--json")
    report = json.loads(out)
    assert report["added"] == sorted(LINES)
    assert list(report["refused"]) == ["broken"]
    corpus = Corpus.open(folder)
    assert (corpus.performer, corpus.fps, corpus.layout.channels) == ("Actor 26", 25, 1404)
    assert "90 mm" in corpus.notes
    utterance = corpus["bgbsza"]
    assert utterance.speech.text == LINES["bgbsza"]
    assert utterance.speech.phones.labels[1:4] == ("b", "ih", "n")
    gap = lip_gap(utterance.motion)
    assert gap.min() < 3
    assert 6 < gap.max() < 25
    assert utterance.motion.head is not None
    assert utterance.motion.eyes is not None
    again = run("add", folder, *videos(clips), "--jobs", 1)
    assert "added 0, already there 3" in again


def test_two_processes_give_the_same_bytes_as_one(clips, tmp_path):
    texts = read_transcripts(clips / "lines.csv")
    made = []
    for jobs in (1, 2):
        corpus = corpus_from_video(
            tmp_path / f"c{jobs}", videos(clips), {"performer": "A", "emotions": ["neutral"]}, workers=Workers(jobs)
        )
        report = add(corpus, videos(clips), texts=texts, workers=Workers(jobs))
        assert (len(report.added), report.refused) == (3, {})
        made.append(contents(corpus.path))
    assert made[0] == made[1]


@pytest.mark.slow
def test_killed_fifty_times_while_following_faces_gives_the_same_corpus(clips, landmark_models, tmp_path, monkeypatch):
    """Every fifth time all tracks are forgotten, so that the end also comes while a face is followed."""
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path / "cache"))
    shutil.copytree(landmark_models, tmp_path / "cache" / "landmarks")
    options = [*videos(clips), "--text-file", str(clips / "lines.csv"), "--performer", "A"]
    killed_and_repeated(
        lambda target: ["add", str(target), *options, "--jobs", "2"], tmp_path, 50, seed=6, forget=tmp_path / "cache" / "tracks"
    )


def test_damaged_pictures_are_told(clips, tmp_path):
    corpus = corpus_from_video(tmp_path / "c", [clips], {"performer": "A", "emotions": ["neutral"]})
    assert "damaged" not in str(add(corpus, [clips / "bgbsza.mpg"]).remarks)
    content = bytearray((clips / "lrbi7p.mpg").read_bytes())
    rng = np.random.default_rng(1)
    for place in rng.integers(2000, len(content), 40):
        content[place] = rng.integers(256)
    (clips / "hurt.mpg").write_bytes(content)
    report = add(corpus, [clips / "hurt.mpg"], {"text": LINES["lrbi7p"]})
    assert report.added == ("hurt",)
    assert any("pictures are damaged in the file" in remark for remark in report.remarks["hurt"])
    assert "pictures are damaged" in (corpus.path / "import.csv").read_text(encoding="utf-8")


def test_another_rate_is_resampled_and_another_layout_refused(clips):
    from corpora import tiny_layout

    clip = clips / "bgbsza.mpg"
    layout = landmark_layout(neutral_shape([kept_track(clip)]))
    motion, remarks = motion_from_video(clip, clip, layout, 60)
    assert (motion.fps, len(motion)) == (60, 180)
    assert remarks == ("resampled from 25 to 60 fps",)
    with pytest.raises(FacesynthError, match="another layout"):
        motion_from_video(clip, clip, tiny_layout(), 25)


def test_a_video_is_sound_and_motion_unless_files_of_its_name_are(tmp_path):
    for name in ("a.mp4", "b.mp4", "b.npz", "c.mov", "c.wav", "d.mp4", "d.avi"):
        (tmp_path / name).touch()
    found, refused = find_recordings([tmp_path])
    assert {r.name: (r.sound.name, r.motion.name) for r in found} == {
        "a": ("a.mp4", "a.mp4"),
        "b": ("b.mp4", "b.npz"),
        "c": ("c.wav", "c.mov"),
    }
    assert list(refused) == ["d"]


def test_sound_that_was_recorded_apart_is_laid_on_the_video(clips):
    clip = clips / "bgbsza.mpg"
    audio, rate = load_audio(clip)
    noise = 0.003 * np.random.default_rng(0).standard_normal(len(audio) + rate // 5)
    save_wav(clips / "bgbsza.wav", (np.r_[np.zeros(rate // 5), 0.5 * audio] + noise).astype(np.float32), rate)
    layout = landmark_layout(neutral_shape([kept_track(clip)]))
    own, _ = motion_from_video(clip, clip, layout, 25)
    moved, remarks = motion_from_video(clip, clips / "bgbsza.wav", layout, 25)
    assert "+200 ms" in remarks[0]
    assert len(moved) == len(own) + 5
    assert np.isnan(moved.frames[:5]).all()
    assert np.abs(moved.frames[5:] - own.frames).max() < 0.05


def test_nothing_to_make_a_corpus_from_is_one_clear_error(tmp_path):
    (tmp_path / "a.wav").touch()
    with pytest.raises(FacesynthError, match="is no corpus yet, and there is no recording"):
        corpus_from_video(tmp_path / "c", [tmp_path / "a.wav"], {"performer": "A", "emotions": ["neutral"]})
    (tmp_path / "a.mp4").write_bytes(b"x" * 100)
    with pytest.raises(FacesynthError, match=r"a\.mp4|facesynth fetch landmarks"):
        corpus_from_video(tmp_path / "c", [tmp_path / "a.mp4"], {"performer": "A", "emotions": ["neutral"]})
    assert not (tmp_path / "c").exists()


def test_transcripts_by_name(tmp_path):
    table = tmp_path / "lines.csv"
    table.write_text('id,note,text\nclip 1.MP4,,"Hello,  you."\nb.2,x,there\n', encoding="utf-8-sig")
    assert read_transcripts(table) == {"clip 1": "Hello, you.", "b.2": "there"}
    for content in ("", "a,b\n", "id\nx\n", "id,text\na,b,c\n", 'id,text\n"a'):
        table.write_text(content, encoding="utf-8")
        with pytest.raises(FacesynthError, match=r"lines\.csv"):
            read_transcripts(table)
    table.write_text("id,text\na,Übung\n", encoding="latin-1")
    assert read_transcripts(table) == {"a": "Übung"}


def test_each_clip_finds_its_part_of_a_recorder_that_ran_on(tmp_path):
    rate = 16000
    rng = np.random.default_rng(0)
    long = (rng.standard_normal(30 * rate) * np.repeat(rng.uniform(0.02, 0.5, 200), 30 * rate // 200)).astype(np.float32) * 0.3
    for name, start_s in (("a", 3.0), ("b", 21.5)):
        pictures = [np.full((32, 32, 3), 90, np.uint8)] * 100
        sound = long[int(start_s * rate) : int((start_s + 4) * rate)]
        write_video(tmp_path / f"{name}.mp4", pictures, sound=sound)
    other = (rng.standard_normal(4 * rate) * np.repeat(rng.uniform(0.02, 0.5, 20), 4 * rate // 20)).astype(np.float32) * 0.3
    write_video(tmp_path / "c.mp4", [np.full((32, 32, 3), 90, np.uint8)] * 100, sound=other)
    save_wav(tmp_path / "recorder.wav", long, rate)
    with cut_for(tmp_path / "recorder.wav", sorted(tmp_path.glob("*.mp4"))) as cuts:
        assert [path.name for path in cuts.sounds] == ["a.wav", "b.wav"]
        for path, start_s in zip(cuts.sounds, (3.0, 21.5), strict=True):
            part, part_rate = load_audio(path)
            assert part_rate == rate
            first = int(start_s * rate)
            best = min(
                range(-800, 801, 8), key=lambda lag: float(np.abs(part[1000:20000] - long[first + lag + 1000 :][:19000]).mean())
            )
            assert abs(best) / rate < 0.06, "the sound of a video may begin a packet late"
        assert "c keeps the camera's own sound" in cuts.remarks[0]
        found, _ = find_recordings([tmp_path / "a.mp4", *cuts.sounds[:1]])
        assert found[0].sound == cuts.sounds[0]
    assert not cuts.sounds[0].exists()
