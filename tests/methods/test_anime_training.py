from pathlib import Path

import pytest
from corpora import tiny_corpus

from facesynth.config import load_config
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.emotion.detector import DetectorSettings, EmotionDetector
from facesynth.methods.registry import load

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("train") / "corpus", utterances=20)


def test_configs_name_only_known_settings():
    assert AnimeGraph.from_config(load_config(ROOT / "configs" / "anime_graph.yaml")).config == AnimeGraph().config
    paper = AnimeGraph.from_config(load_config(ROOT / "configs" / "anime_graph_paper.yaml")).config
    assert (paper["variance"], paper["map_width"]) == (0.95, "closest")
    assert AnimeGraph.from_config(load_config(ROOT / "configs" / "anime_graph_soft.yaml")).config["temperature"] > 0
    assert DetectorSettings.from_config(load_config(ROOT / "configs" / "emotion.yaml")) == DetectorSettings()
    assert DetectorSettings.from_config(load_config(ROOT / "configs" / "emotion_paper.yaml")).features == "paper"


def test_training_the_anime_graph(corpus, tmp_path, script):
    model = tmp_path / "graph.safetensors"
    # Two sentences, when one of three is left out, are no evidence: the components are named.
    said = script("anime_graph.py", corpus.path, "-o", model, "--maps", "5", "map_centres=30", "emotional_components=[1]")
    assert "jumps in" in said
    assert "neutral to happy, each of 3 sentences left out" in said
    assert "needs at least 3 sentences" in said
    assert load(model).name == "anime_graph"


def test_training_the_detector(corpus, tmp_path, script):
    detector = tmp_path / "emotion.safetensors"
    said = script("emotion.py", corpus.path, "-o", detector)
    assert "by sentence" in said
    utterance = next(iter(corpus))
    assert EmotionDetector.load(detector).detect(utterance.speech.audio, 16000).emotion in corpus.emotions
