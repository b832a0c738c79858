"""Small trained models and the folders that they are exported to."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from corpora import RATE, tiny_corpus, tiny_utterances, twin_corpus


@pytest.fixture(scope="session")
def runtime_folder(repository, tmp_path_factory) -> Path:
    """A folder that holds facesynth_runtime as its wheel does, and nothing else."""
    folder = tmp_path_factory.mktemp("runtime")
    shutil.copytree(
        repository / "facesynth" / "inference", folder / "facesynth_runtime", ignore=shutil.ignore_patterns("__pycache__")
    )
    return folder


@pytest.fixture(scope="session")
def small_corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("export") / "tiny", utterances=12, fps=60)


@pytest.fixture(scope="session")
def speeches():
    """Sentences that the corpus does not have."""
    return [speech for _, speech, _ in tiny_utterances(4, 60, seed=3)]


@pytest.fixture(scope="session")
def long_sound(speeches):
    return np.concatenate([speech.audio for speech in speeches]), RATE


@pytest.fixture(scope="session")
def lds_file(small_corpus, tmp_path_factory):
    from facesynth.methods.lds.method import LDS

    quick = {
        "hears": "periodogram",
        "features": 4,
        "components": 4,
        "rows": 6,
        "lead_ms": 40,
        "deterministic_order": 2,
        "stochastic_order": 2,
    }
    path = tmp_path_factory.mktemp("models") / "lds.safetensors"
    LDS(**quick).fit(small_corpus).save(path)
    return path


@pytest.fixture(scope="session")
def efase_file(small_corpus, tmp_path_factory):
    from facesynth.methods.efase.method import Efase

    path = tmp_path_factory.mktemp("models") / "efase.safetensors"
    Efase(components=12, database_fps=120).fit(small_corpus).save(path)
    return path


@pytest.fixture(scope="session")
def coarticulation_file(small_corpus, tmp_path_factory):
    from facesynth.methods.coarticulation.method import Coarticulation

    path = tmp_path_factory.mktemp("models") / "coarticulation.safetensors"
    Coarticulation(triphones=3).fit(small_corpus).save(path)
    return path


@pytest.fixture(scope="session")
def eyes_file(tmp_path_factory):
    from living_eyes import learnt, recording

    path = tmp_path_factory.mktemp("models") / "eyes.safetensors"
    learnt(recording(seed=1)).save(path)
    return path


@pytest.fixture(scope="session")
def expression_file(tmp_path_factory):
    from facesynth.methods.expression.method import Expression

    folder = tmp_path_factory.mktemp("models")
    Expression().fit(twin_corpus(folder / "twins", sentences=4)).save(folder / "expression.safetensors")
    return folder / "expression.safetensors"


@pytest.fixture(scope="session")
def anime_file(small_corpus, tmp_path_factory):
    from facesynth.methods.anime_graph.method import AnimeGraph

    path = tmp_path_factory.mktemp("models") / "anime_graph.safetensors"
    AnimeGraph(map_centres=40, emotional_components=[0, 2]).fit(small_corpus).save(path)
    return path


@pytest.fixture(scope="session")
def emotion_file(small_corpus, tmp_path_factory):
    from facesynth.methods.emotion.clips import clips_of_corpus
    from facesynth.methods.emotion.detector import EmotionDetector

    path = tmp_path_factory.mktemp("models") / "emotion.safetensors"
    detector = EmotionDetector().fit(clips_of_corpus(small_corpus))
    detector.provenance = small_corpus.provenance()
    detector.save(path)
    return path


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """A function from a model file to its folder, exported once."""
    from facesynth.export.models import export_model

    known = {}

    def folder_of(path, weights="float32"):
        if (path, weights) not in known:
            known[path, weights] = tmp_path_factory.mktemp("folders") / f"{path.stem}_{weights}"
            export_model(path, known[path, weights], weights)
        return known[path, weights]

    return folder_of
