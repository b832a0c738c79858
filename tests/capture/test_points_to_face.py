"""From videos of a speaker to a new video of the speaker, through the command line."""

import json
import sys

import numpy as np
import pytest
from chewing import BOX, HEIGHT, WIDTH, Chewing, drawn, skin
from click.testing import CliRunner

from facesynth.cli.corpus import corpus_group
from facesynth.cli.speak import speak
from facesynth.cli.train import train
from facesynth.corpus import Corpus
from facesynth.corpus.importers.points import kept_videos, shapes_beside
from facesynth.face.draw.video import read_video, write_video
from facesynth.face.texture.speaker import Speaker
from facesynth.inference.errors import FacesynthError
from facesynth.motion.planar import is_tracked
from facesynth.speech.audio import save_wav
from facesynth.stage.speaker_pictures import face_path, speaker_of

pytest.importorskip("cv2")
FPS, FRAMES, RATE = 25, 50, 16_000
PLACE = ",".join(map(str, BOX))


def loudness(seed):
    """[T] 0..1, changing every fifth frame, smoothed."""
    steps = np.repeat(np.random.default_rng(seed).uniform(0, 1, FRAMES // 5), 5)
    return np.convolve(np.pad(steps, 2, mode="edge"), np.ones(5) / 5, mode="valid")


def sound(seed):
    rng = np.random.default_rng([seed, 1])
    return 0.2 * rng.normal(size=FRAMES * RATE // FPS) * np.repeat(loudness(seed), RATE // FPS)


def film(path, seed, texture):
    """A clip whose mouth opens with the loudness of its sound."""
    grey = drawn(texture, Chewing(FRAMES, 0.3 * seed, 5 * loudness(seed)))
    write_video(path, np.repeat(grey[..., None], 3, axis=-1), FPS, sound(seed), RATE)
    path.with_suffix(".lab").write_text(f"{FRAMES / FPS} aa\n")


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """A corpus of followed points, a model that learned from it, and where both are."""
    folder = tmp_path_factory.mktemp("studio")
    (folder / "clips").mkdir()
    texture = skin(0)
    for seed in range(6):
        film(folder / "clips" / f"c{seed}.mp4", seed, texture)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FACESYNTH_CACHE", str(folder / "cache"))
        added = json.loads(
            run(corpus_group, "add", folder / "actor", folder / "clips", "--points", "--box", PLACE, "--jobs", 1, "--json")
        )
    model = folder / "actor.safetensors"
    settings = (
        "hears=periodogram",
        "features=2",
        "components=2",
        "lead_ms=0",
        "deterministic_order=2",
        "stochastic_order=2",
        "rows=4",
    )
    trained = run(train, "lds", folder / "actor", *settings, "-o", model)
    return folder, added, model, trained


def run(command, *arguments):
    result = CliRunner().invoke(command, list(map(str, arguments)))
    if isinstance(result.exception, FacesynthError):
        raise result.exception
    assert result.exit_code == 0, (result.output, result.exception)
    return result.stdout


def test_videos_become_a_corpus_of_followed_points(studio):
    folder, added, _, _ = studio
    corpus = Corpus.open(folder / "actor")
    assert added["added"] == [f"c{seed}" for seed in range(6)]
    assert is_tracked(corpus.layout)
    assert corpus.fps == FPS
    assert all("lost" in remarks[0] and "drift" in remarks[0] for remarks in added["remarks"].values())
    for utterance in corpus:
        opening = utterance.motion.frames.reshape(FRAMES, -1, 2)[:, :, 1].mean(axis=1)
        assert np.corrcoef(opening, -loudness(int(utterance.id[1:])))[0, 1] > 0.95
        video = kept_videos(corpus)[utterance.id]
        assert video.read_bytes() == (folder / "clips" / video.name).read_bytes()
        np.testing.assert_allclose(shapes_beside(video).to_motion(corpus.layout).frames, utterance.motion.frames, atol=1e-3)
    assert not any(problem["grave"] for problem in json.loads(run(corpus_group, "check", folder / "actor", "--json"))["problems"])


def test_a_new_sound_becomes_a_video_of_the_speaker(studio):
    folder, _, model, trained = studio
    assert face_path(model).name in trained
    save_wav(folder / "new.wav", sound(9).astype(np.float32), RATE)
    (folder / "new.lab").write_text(f"{FRAMES / FPS} aa\n")
    out = folder / "new.mp4"
    report = json.loads(
        run(
            speak,
            model,
            folder / "new.wav",
            "--phones",
            folder / "new.lab",
            "--noise",
            0,
            "-o",
            out,
            "-o",
            folder / "new.npz",
            "--json",
        )
    )
    video = read_video(out)
    assert video.frames.shape == (FRAMES, HEIGHT, WIDTH, 3)
    assert float(video.fps) == FPS
    assert len(video.audio) / video.sample_rate == pytest.approx(FRAMES / FPS, abs=0.05)
    assert report["folded_triangles"] == 0
    assert report["real_time_factor"] > 0
    with np.load(folder / "new.npz") as kept:
        opening = -kept["frames"].reshape(FRAMES, -1, 2)[:, :, 1].mean(axis=1)
    assert np.corrcoef(opening, loudness(9))[0, 1] > 0.8
    # The real face says it: the drawn pictures are those that a camera would have seen, but for the way the head was held.
    speaker = Speaker.load(face_path(model))
    change = np.abs(np.diff(video.frames.astype(float), axis=0)).mean(axis=(1, 2, 3))
    assert change.max() < 4 * np.abs(np.diff(speaker.backgrounds.astype(float), axis=0)).mean(axis=(1, 2, 3)).max()


def test_another_clip_joins_a_corpus_that_is_there(studio, monkeypatch):
    folder = studio[0]
    monkeypatch.setenv("FACESYNTH_CACHE", str(folder / "cache"))
    run(
        corpus_group,
        "add",
        folder / "second",
        folder / "clips" / "c0.mp4",
        folder / "clips" / "c0.lab",
        "--points",
        "--box",
        PLACE,
    )
    later = run(corpus_group, "add", folder / "second", folder / "clips" / "c1.mp4", folder / "clips" / "c1.lab", "--id", "later")
    assert "added 1" in later
    corpus = Corpus.open(folder / "second")
    assert sorted(kept_videos(corpus)) == ["c0", "later"]
    assert "already there 1" in run(
        corpus_group, "add", folder / "second", folder / "clips" / "c0.mp4", folder / "clips" / "c0.lab"
    )


def refused(tmp_path, *arguments):
    """The one line of an error; the corpus must not be there."""
    with pytest.raises(FacesynthError) as raised:
        run(corpus_group, "add", tmp_path / "actor", *arguments, "--jobs", 1)
    assert not (tmp_path / "actor").exists()
    assert "\n" not in str(raised.value)
    return str(raised.value)


def test_video_without_sound_is_refused(tmp_path):
    grey = drawn(skin(0), Chewing(20))
    write_video(tmp_path / "mute.mp4", np.repeat(grey[..., None], 3, axis=-1), FPS)
    assert "mute.mp4 has no sound" in refused(tmp_path, tmp_path / "mute.mp4", "--points", "--box", PLACE)


def test_sound_without_a_picture_is_refused(tmp_path):
    save_wav(tmp_path / "only.wav", sound(0).astype(np.float32), RATE)
    assert "there is no video" in refused(tmp_path, tmp_path / "only.wav", "--points", "--box", PLACE)


def test_a_cut_in_the_middle_is_refused(tmp_path):
    bright, dark = np.full((12, HEIGHT, WIDTH, 3), 220, np.uint8), np.full((12, HEIGHT, WIDTH, 3), 30, np.uint8)
    write_video(tmp_path / "cut.mp4", np.concatenate([bright, dark]), FPS, sound(0)[:16000], RATE)
    assert "has a cut at 0.48 s" in refused(tmp_path, tmp_path / "cut.mp4", "--points", "--box", PLACE)


def test_a_bad_box_or_mask_is_refused(studio, tmp_path):
    clip = studio[0] / "clips" / "c0.mp4"
    assert "--box wants LEFT,TOP,RIGHT,BOTTOM" in refused(tmp_path, clip, "--points", "--box", "1,2,3")
    assert "must lie in the picture" in refused(tmp_path, clip, "--points", "--box", "0,0,900,900")
    (tmp_path / "mask.png").write_bytes(b"no picture")
    assert "cannot be read as a picture" in refused(tmp_path, clip, "--points", "--mask", tmp_path / "mask.png")


def test_a_drawn_mask_says_where_the_lower_face_is(studio, tmp_path, monkeypatch):
    from PIL import Image

    monkeypatch.setenv("FACESYNTH_CACHE", str(studio[0] / "cache"))
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[60:110, 50:110] = 255
    Image.fromarray(mask).save(tmp_path / "mask.png")
    clips = studio[0] / "clips"
    run(corpus_group, "add", tmp_path / "actor", clips / "c0.mp4", clips / "c0.lab", "--mask", tmp_path / "mask.png")
    points = shapes_beside(kept_videos(Corpus.open(tmp_path / "actor"))["c0"]).points
    assert 40 < points[:, :, 0].min() < points[:, :, 0].max() < 120
    assert points[:, :, 1].min() > 50


def test_a_missing_face_file_is_one_clear_line(studio, tmp_path):
    _, _, model, _ = studio
    alone = tmp_path / "alone.safetensors"
    alone.write_bytes(model.read_bytes())
    save_wav(tmp_path / "new.wav", sound(9).astype(np.float32), RATE)
    (tmp_path / "new.lab").write_text(f"{FRAMES / FPS} aa\n")
    with pytest.raises(FacesynthError, match=r"alone\.face\.npz: no such file"):
        run(speak, alone, tmp_path / "new.wav", "--phones", tmp_path / "new.lab", "-o", tmp_path / "out.mp4")
    with pytest.raises(FacesynthError, match=r"no head for \.glb"):
        run(speak, model, tmp_path / "new.wav", "--phones", tmp_path / "new.lab", "-o", tmp_path / "out.glb")
    assert not (tmp_path / "out.mp4").exists()


def test_options_that_do_nothing_are_named(studio, tmp_path):
    save_wav(tmp_path / "new.wav", sound(9).astype(np.float32), RATE)
    (tmp_path / "new.lab").write_text(f"{FRAMES / FPS} aa\n")
    arguments = [studio[2], tmp_path / "new.wav", "--phones", tmp_path / "new.lab", "--fps", 60, "-o", tmp_path / "out.mp4"]
    result = CliRunner().invoke(speak, list(map(str, [*arguments, "--pictures", "nearest"])))
    assert "warning: --fps: a real face keeps the rate" in result.stderr
    assert float(read_video(tmp_path / "out.mp4").fps) == FPS


def test_clips_in_another_light_give_no_pictures(studio, tmp_path, monkeypatch):
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path / "cache"))
    texture = skin(0)
    for seed in range(4):
        film(tmp_path / f"c{seed}.mp4", seed, texture if seed else 0.7 * texture)
    clips = sorted(tmp_path.glob("c*.*"))
    run(corpus_group, "add", tmp_path / "actor", *clips, "--points", "--box", PLACE, "--jobs", 1)
    speaker = speaker_of(Corpus.open(tmp_path / "actor"))
    assert len(speaker.pictures) == 3 * FRAMES
    assert speaker.clip_starts.sum() == 3


def test_silence_is_one_clear_line(studio, tmp_path):
    save_wav(tmp_path / "quiet.wav", np.zeros(RATE, np.float32), RATE)
    with pytest.raises(FacesynthError, match="silent"):
        run(speak, studio[2], tmp_path / "quiet.wav", "-o", tmp_path / "out.mp4")
    assert not (tmp_path / "out.mp4").exists()


def test_two_faces_or_none_are_refused(recordings, landmark_models, tmp_path):
    """Where nobody says where the face is, it is looked for."""
    clip = read_video(sorted(recordings("grid_s26").glob("*.mpg"))[0])
    frames, audio = clip.frames[:30], clip.audio[: round(1.2 * clip.sample_rate)]
    both = np.concatenate([frames, frames], axis=2)
    write_video(tmp_path / "both.mp4", both, 25, audio, clip.sample_rate)
    assert "there are 2 faces in the picture" in refused(tmp_path, tmp_path / "both.mp4", "--points")
    blank = np.full((30, HEIGHT, WIDTH, 3), 90, np.uint8)
    write_video(tmp_path / "blank.mp4", blank, 25, audio, clip.sample_rate)
    assert "no face is found" in refused(tmp_path, tmp_path / "blank.mp4", "--points")
    (tmp_path / "both.lab").write_text("1.2 aa\n")
    run(
        corpus_group, "add", tmp_path / "left", tmp_path / "both.mp4", tmp_path / "both.lab", "--points", "--face", 1, "--jobs", 1
    )
    points = shapes_beside(kept_videos(Corpus.open(tmp_path / "left"))["both"]).points
    assert points[:, :, 0].max() < 360


def test_help_does_not_load_torch():
    import subprocess

    code = "import sys; from facesynth.cli.corpus import corpus_group; sys.exit('torch' in sys.modules or 'cv2' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(("method", "settings"), [("efase", ()), ("network", ("steps=20", "features=log_mel"))])
def test_any_methods_motion_drives_the_real_face(studio, tmp_path, method, settings):
    """Trained and spoken by the same two commands as the linear dynamical system, with the same pictures."""
    folder, model = studio[0], tmp_path / f"{method}.safetensors"
    trained = run(train, method, folder / "actor", *settings, "-o", model)
    assert face_path(model).name in trained
    out = tmp_path / "new.mp4"
    sounds = folder / "clips" / "c3.mp4", folder / "clips" / "c3.lab"
    report = json.loads(run(speak, model, sounds[0], "--phones", sounds[1], "-o", out, "-o", tmp_path / "new.npz", "--json"))
    assert report["folded_triangles"] == 0
    video = read_video(out)
    assert video.frames.shape == (FRAMES, HEIGHT, WIDTH, 3)
    with np.load(tmp_path / "new.npz") as kept:
        moved = np.ptp(kept["frames"], axis=0).max()
    recorded = np.ptp(Corpus.open(folder / "actor")["c3"].motion.frames, axis=0).max()
    assert 0.3 * recorded < moved < 2 * recorded
