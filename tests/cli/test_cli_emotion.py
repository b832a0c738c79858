"""Emotions on the command line: heard in a voice, taken over into speech, mapped onto motion."""

import csv
import json
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from corpora import tiny_corpus

from facesynth.cli import cli, main
from facesynth.face.rig.arkit_rig import load_head
from facesynth.face.rig.markers import marker_layout
from facesynth.inference.motion import Motion
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.efase.method import Efase
from facesynth.methods.emotion.clips import clips_of_corpus
from facesynth.methods.emotion.detector import Clip, EmotionDetector
from facesynth.speech.audio import load_audio, save_wav
from facesynth.speech.emotions import read_emotions
from facesynth.speech.textgrid import write_textgrid


@pytest.fixture(scope="module")
def shop(rig, tmp_path_factory):
    """A performer whose markers are the head's; models of both methods, a detector and two recordings."""
    folder = tmp_path_factory.mktemp("feeling")
    corpus = on_the_head(folder, tiny_corpus(folder / "source", utterances=24, fps=60))
    AnimeGraph(variance=0.98, map_centres=30).fit(corpus).save(folder / "graph.safetensors")
    Efase().fit(corpus).save(folder / "efase.safetensors")
    clips = clips_of_corpus(corpus)
    EmotionDetector().fit(clips).save(folder / "emotion.safetensors")
    EmotionDetector().fit([piece for e in ("neutral", "happy") for piece in pieces_of(clips, e)]).save(folder / "two.safetensors")
    for emotion in ("neutral", "happy"):
        utterance = next(u for u in corpus if u.emotion == emotion)
        save_wav(folder / f"{emotion}.wav", utterance.speech.audio, utterance.speech.sample_rate)
        write_textgrid(folder / f"{emotion}.TextGrid", utterance.speech.phones)
    return folder


def pieces_of(clips, emotion):
    """All recordings of an emotion one after the other, in pieces as long as the windows that are listened to."""
    rate = clips[0].rate
    sound = np.concatenate([c.audio for c in clips if c.emotion == emotion])
    starts = range(0, len(sound) - 2 * rate, rate // 2)
    return [Clip(sound[start : start + 2 * rate], rate, emotion, sentence=str(start // rate)) for start in starts]


def on_the_head(folder, source):
    """The tiny corpus' chin, lips, corners and brows put on markers of the head, 4 random shapes on the rest."""
    from facesynth.corpus import Corpus

    layout = marker_layout(load_head())
    place = {"lip_upper": "upper_inner", "lip_lower": "lower_inner", "chin": "chin"}
    place |= {
        f"{part}_{side}": f"{mark}_{side}{n}" for side in "rl" for part, mark, n in (("brow", "brow", 3), ("cheek", "cheek", 5))
    }
    place |= {f"corner_{side}": f"mouth_corner_{side}" for side in "rl"}
    corpus = Corpus.create(folder / "head", performer="Tiny", layout=layout, fps=60, emotions=source.emotions)
    neutral = np.array(layout.neutral).reshape(-1, 3)
    tiny = np.array(source.layout.neutral).reshape(-1, 3)
    for utterance in source:
        points = np.tile(neutral, (len(utterance.motion), 1, 1))
        for name, marker in place.items():
            index = source.layout.names.index(name)
            points[:, layout.names.index(marker)] += (utterance.motion.points[:, index] - tiny[index]) * 0.4
        corpus.add_utterance(source.record(utterance.id), utterance.speech, Motion(points.reshape(len(points), -1), 60, layout))
    return corpus


def ran(*arguments):
    result = CliRunner().invoke(cli, list(map(str, arguments)))
    assert result.exit_code == 0, result.output
    return result


def refused(monkeypatch, capsys, *arguments):
    monkeypatch.setattr(sys, "argv", ["facesynth", *map(str, arguments)])
    with pytest.raises(SystemExit) as left:
        main()
    lines = capsys.readouterr().err.strip().splitlines()
    assert left.value.code == 2
    assert lines[-1].startswith("error: ")
    assert sum(line.startswith("error") for line in lines) == 1
    return lines[-1]


def markers(path):
    with np.load(path, allow_pickle=False) as file:
        return file["frames"].reshape(len(file["frames"]), -1, 3)


def corner_height(path):
    names = marker_layout(load_head()).names
    return markers(path)[:, [names.index("mouth_corner_l"), names.index("mouth_corner_r")], 1].mean()


def test_the_emotion_of_a_recording(shop):
    said = ran("emotion", shop / "emotion.safetensors", shop / "happy.wav").stdout
    assert said.startswith(f"{shop / 'happy.wav'}: happy (")
    both = json.loads(ran("emotion", shop / "emotion.safetensors", shop / "happy.wav", shop / "neutral.wav", "--json").stdout)
    assert [r["emotion"] for r in both] == ["happy", "neutral"]
    assert sum(both[0]["probabilities"].values()) == pytest.approx(1)
    assert both[1]["track"] == [{"end_s": pytest.approx(both[1]["duration_s"]), "emotion": "neutral"}]


def two_moods(shop, path):
    """The neutral recording three times, then the happy one three times; returns where one becomes the other."""
    (calm, rate), (happy, _) = (load_audio(shop / f"{name}.wav") for name in ("neutral", "happy"))
    save_wav(path, np.concatenate([calm, calm, calm, happy, happy, happy]), rate)
    return 3 * len(calm) / rate


def test_emotions_over_time_become_a_track_that_speak_reads(shop, tmp_path):
    change_s = two_moods(shop, tmp_path / "long.wav")
    track = tmp_path / "track.csv"
    facts = json.loads(ran("emotion", shop / "two.safetensors", tmp_path / "long.wav", "--windows", "-o", track, "--json").stdout)
    assert facts["track"][0]["emotion"] == "neutral"
    assert facts["track"][-1]["emotion"] == "happy"
    assert facts["windows"][-1]["end_s"] == pytest.approx(facts["duration_s"])
    emotions = read_emotions(track, facts["duration_s"])
    assert emotions.labels == tuple(row["emotion"] for row in facts["track"])
    calm_until = emotions.ends_s[np.array(emotions.labels) == "neutral"].max()
    assert calm_until == pytest.approx(change_s, abs=1.0)


def test_a_detector_that_normalises_is_given_the_speaker(shop, tmp_path, monkeypatch, capsys):
    clips = [Clip(*load_audio(shop / f"{name}.wav"), name) for name in ("neutral", "happy") for _ in range(3)]
    listing = tmp_path / "clips.csv"
    with listing.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([("file", "emotion"), *((shop / f"{c.emotion}.wav", c.emotion) for c in clips)])
    detector = tmp_path / "own.safetensors"
    facts = json.loads(ran("train", "emotion", listing, "normalise=true", "-o", detector, "--json").stdout)
    assert facts["emotions"] == ["happy", "neutral"]
    assert "recordings of the speaker" in refused(monkeypatch, capsys, "emotion", detector, shop / "happy.wav")
    own = [x for name in ("neutral", "happy") for x in ("--speaker", shop / f"{name}.wav")]
    ran("emotion", detector, shop / "happy.wav", *own, *own)


def test_speaking_with_the_emotion_that_is_heard(shop, tmp_path):
    for emotion in ("neutral", "happy"):
        clip = shop / f"{emotion}.wav"
        said = ran("speak", shop / "graph.safetensors", clip, "-o", tmp_path / "auto.npz", "--emotion", "auto", "--fps", 60)
        assert f"heard: {emotion} to" in said.stderr
        ran("speak", shop / "graph.safetensors", clip, "-o", tmp_path / "named.npz", "--emotion", emotion, "--fps", 60)
        np.testing.assert_array_equal(markers(tmp_path / "auto.npz"), markers(tmp_path / "named.npz"))


def test_speaking_with_emotions_heard_over_time(shop, tmp_path):
    change_s = two_moods(shop, tmp_path / "long.wav")
    (tmp_path / "phones.txt").write_text(f"{change_s} aa\n{2 * change_s - 0.5} iy\n", encoding="utf-8")
    said = ran("speak", shop / "efase.safetensors", tmp_path / "long.wav", "-o", tmp_path / "o.npz",
               "--phones", tmp_path / "phones.txt", "--emotions", "auto", "--detector", shop / "two.safetensors")  # fmt: skip
    heard = next(line for line in said.stderr.splitlines() if line.startswith("heard: "))
    assert heard.startswith("heard: neutral to")
    assert "happy to" in heard


@pytest.mark.parametrize("model", ["graph", "efase"])
def test_motion_of_either_method_is_mapped_to_another_emotion(shop, tmp_path, model):
    heights = []
    for name, arguments in (
        ("plain", []),
        ("half", ["--to-emotion", "happy", "--to-intensity", 0.5]),
        ("full", ["--to-emotion", "happy"]),
    ):
        maps = ["--maps", shop / "graph.safetensors"] if model == "efase" and arguments else []
        clip, out = shop / "neutral.wav", tmp_path / f"{name}.npz"
        ran("speak", shop / f"{model}.safetensors", clip, "-o", out, "--emotion", "neutral", *arguments, *maps)
        heights.append(corner_height(out))
    assert heights[2] - heights[0] > 0.8
    assert heights[1] - heights[0] == pytest.approx((heights[2] - heights[0]) / 2, rel=0.2)


def test_looking_ahead_says_what_it_loses_and_explains(shop, tmp_path):
    out, why = tmp_path / "o.npz", tmp_path / "why.json"
    said = ran("speak", shop / "graph.safetensors", shop / "happy.wav", "-o", out, "--emotion", "happy",
               "--look-ahead", 2, "--explain", why, "--json")  # fmt: skip
    assert "look-ahead of 2 phones: " in said.stderr
    assert json.loads(said.stdout)["search"]["extra_cost"] >= 0
    assert len(json.loads(why.read_text(encoding="utf-8"))) == json.loads(said.stdout)["search"]["phones"]


def test_either_way_to_move_the_skin(shop, tmp_path):
    pytest.importorskip("av")
    films = []
    for way in ("shapes", "distance", "regions"):
        out = tmp_path / f"{way}.mp4"
        ran("speak", shop / "graph.safetensors", shop / "happy.wav", "-o", out, "--emotion", "happy",
            "--fps", 4, "--size", "64x64", "--deform", way)  # fmt: skip
        films.append(out.read_bytes())
    assert len(set(films)) == 3


def test_what_cannot_be_heard_or_mapped_is_one_line(shop, tmp_path, monkeypatch, capsys):
    def line(*arguments):
        return refused(monkeypatch, capsys, *arguments)

    graph, clip, out = shop / "graph.safetensors", shop / "neutral.wav", tmp_path / "o.npz"
    speak = ("speak", graph, clip, "-o", out, "--emotion", "neutral")
    assert "needs at least 3 sentences recorded in both" in line(*speak, "--to-emotion", "angry")
    assert "unknown emotion 'bored'" in line(*speak, "--to-emotion", "bored")
    assert "unknown emotion 'bored'" in line("speak", graph, clip, "-o", out, "--emotion", "bored")
    assert "learns no emotion maps" in line("speak", shop / "efase.safetensors", clip, "-o", out, "--to-emotion", "happy")
    assert "--maps belongs to" in line(*speak, "--maps", graph)
    assert "not an emotion detector" in line("speak", graph, clip, "-o", out, "--emotion", "auto", "--detector", graph)
    assert "not an emotion detector" in line("emotion", graph, clip)
    lonely = tmp_path / "lonely.safetensors"
    lonely.write_bytes(graph.read_bytes())
    assert "train emotion" in line("speak", lonely, clip, "-o", out, "--emotion", "auto")
    other = [Clip(*load_audio(shop / f"{name}.wav"), name[::-1]) for name in ("neutral", "happy") for _ in range(2)]
    EmotionDetector().fit(other).save(tmp_path / "other.safetensors")
    strangers = line("speak", graph, clip, "-o", out, "--emotion", "auto", "--detector", tmp_path / "other.safetensors")
    assert "hears lartuen, yppah; this model knows neutral" in strangers
    save_wav(tmp_path / "flat.wav", np.full(16000, 0.2, np.float32), 16000)
    assert "silent" in line("emotion", shop / "emotion.safetensors", tmp_path / "flat.wav")
    lacking = line("speak", shop / "efase.safetensors", clip, "-o", out, "--look-ahead", 3)
    assert "efase has no option --look-ahead; it is one of anime_graph" in lacking
    assert not out.exists()
