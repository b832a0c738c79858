import json
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml

import facesynth
from facesynth.evaluation.lips import lip_opening
from facesynth.inference.errors import FacesynthError
from facesynth.inference.folder import CARD, MANIFEST, open_folder, place_of
from facesynth.speech.audio import save_wav
from facesynth.zoo.card import Card, card_of, draft, read_card, write_card
from facesynth.zoo.parcel import SUFFIX, pull, push
from facesynth.zoo.shelf import DEFAULT, PACKAGED, entry, find, names

TORCH = ("torch", "torchaudio", "kornia", "sklearn", "optuna")
BLOCKED = f"""
import importlib.abc, importlib.util, sys
class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name.partition(".")[0] in {TORCH}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Blocked())
real = importlib.util.find_spec
importlib.util.find_spec = lambda name, *rest: None if name in {TORCH} else real(name, *rest)
from facesynth.cli import main
main()
"""


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path / "cache"))


def without_torch(*arguments):
    command = [sys.executable, "-c", BLOCKED, *map(str, arguments)]
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=300)


def hum(path, seconds=1.0, rate=16000):
    times_s = np.arange(round(seconds * rate)) / rate
    save_wav(path, (0.2 * np.sin(2 * np.pi * 150 * times_s)).astype(np.float32), rate)
    path.with_suffix(".lab").write_text(f"0.3 pau\n0.5 b\n0.8 aa\n{seconds} pau\n")
    return path


@pytest.mark.parametrize("name", sorted(path.parent.name for path in PACKAGED.glob(f"*/{CARD}")))
def test_a_model_of_the_package_has_a_card_that_says_what_it_may_be_used_for(name):
    found = entry(name)
    assert found.card.licence != "unknown"
    assert found.card.rebuild
    assert sum(path.stat().st_size for path in found.path.iterdir()) < 5e6
    for figure in found.card.figures:
        assert figure.command.split()[0] in ("facesynth", "python")


def test_the_default_model_streams_by_its_name_and_one_that_cannot_says_so():
    sound = 0.1 * np.random.default_rng(0).standard_normal(32000).astype(np.float32)
    stream = facesynth.load(DEFAULT).stream()
    frames = np.concatenate([*(stream.push(piece) for piece in np.split(sound, [5000, 5001, 20000])), stream.finish()])
    assert len(frames) == 2 * facesynth.load(DEFAULT).fps
    assert np.isfinite(frames).all()
    assert np.ptp(frames, axis=0).max() > 0.1
    with pytest.raises(FacesynthError, match="coarticulation has no stream; give it whole utterances"):
        facesynth.load("grid-s1").stream()


def test_all_models_of_the_package_are_small_enough_to_come_with_it_and_nothing_large_comes_twice():
    contents = [path.read_bytes() for path in PACKAGED.rglob("*") if path.is_file()]
    assert sum(map(len, contents)) < 15e6
    large = [content for content in contents if len(content) > 100_000]
    assert len(set(large)) == len(large)


def test_what_several_models_have_alike_goes_with_each_that_is_copied_or_sent(tmp_path, own_cache):
    from facesynth.zoo.copying import copy_packaged

    shared = {path.name for path in PACKAGED.iterdir() if path.is_file()}
    copy_packaged(Path(DEFAULT), tmp_path / "copied", changed=False)
    parcel, _ = push(PACKAGED / DEFAULT, tmp_path)
    assert shared
    assert shared < {path.name for path in (tmp_path / "copied").iterdir()}
    assert shared < set(zipfile.ZipFile(parcel).namelist())
    assert entry(DEFAULT).size_bytes == sum(path.stat().st_size for path in (tmp_path / "copied").iterdir())


def test_a_name_speaks_without_torch_and_so_does_no_name(tmp_path):
    sound = hum(tmp_path / "línea.wav")
    named, default = tmp_path / "named.npz", tmp_path / "default.npz"
    phones = ("--phones", sound.with_suffix(".lab"))
    for given, target in (((DEFAULT, sound), named), ((sound,), default)):
        done = without_torch("speak", *given, *phones, "-o", target)
        assert done.returncode == 0, done.stderr
    assert named.read_bytes() == default.read_bytes()
    assert np.load(named)["frames"].std() > 0


def test_the_same_model_is_loaded_by_its_name_and_by_its_folder(speech_of_lips):
    by_name, by_path = facesynth.load(DEFAULT), facesynth.load(PACKAGED / DEFAULT)
    assert np.array_equal(by_name.synthesize(speech_of_lips).frames, by_path.synthesize(speech_of_lips).frames)
    assert by_name.provenance


@pytest.mark.parametrize("name", [name for name in names() if entry(name).part == "mouth" and names()[name].parent == PACKAGED])
def test_every_mouth_of_the_package_opens_and_shuts_in_a_syllable(name, speech_of_lips):
    model = facesynth.load(name)
    motion = model.synthesize(speech_of_lips)
    opening, bounds = lip_opening(motion), speech_of_lips.phones.frame_bounds(motion.fps)
    assert len(motion) == round(speech_of_lips.duration_s * motion.fps)
    assert np.isfinite(motion.frames).all()
    assert opening[bounds[1] : bounds[2]].min() < opening[bounds[2] : bounds[3]].max() - 1


@pytest.fixture
def speech_of_lips():
    from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech

    phones = PhoneTrack(("pau", "m", "aa", "pau"), np.array([0.2, 0.3, 0.5, 0.7]))
    sound = 0.1 * np.random.default_rng(0).standard_normal(11200).astype(np.float32)
    return Speech(sound, 16000, phones, EmotionTrack.constant("neutral", 0.7))


def test_an_extra_that_is_missing_is_named(tmp_path):
    done = without_torch("train", "ridge", tmp_path, "-o", tmp_path / "m.safetensors")
    assert done.returncode == 2
    assert "pip install 'facesynth[train]'" in done.stderr
    assert done.stderr.count("\n") == 1


def test_what_is_called_differently_is_answered_with_the_nearest_names():
    with pytest.raises(FacesynthError, match=f"unknown model '{DEFAULT}x'; did you mean {DEFAULT}"):
        find(f"{DEFAULT}x")


def test_a_model_travels_in_one_file_and_is_the_same_there(tmp_path, own_cache, monkeypatch):
    source = tmp_path / "actor"
    copy(PACKAGED / DEFAULT, source)
    parcel, sha256 = push(source, tmp_path / "out")
    assert push(source, tmp_path / "again")[1] == sha256
    taken = pull(parcel.as_uri(), sha256=sha256)
    assert taken.name == "actor"
    assert "actor" in names()
    assert entry("actor").card == read_card(source / CARD)
    assert pull(str(parcel)).path == taken.path


def copy(folder, target):
    target.mkdir()
    for name in (*open_folder(folder).contents, MANIFEST, CARD):
        (target / name).write_bytes(place_of(folder, name).read_bytes())


def test_what_was_changed_on_the_way_is_not_used(tmp_path, own_cache):
    source = tmp_path / "actor"
    copy(PACKAGED / DEFAULT, source)
    parcel, _ = push(source, tmp_path)
    with pytest.raises(FacesynthError, match="it was changed or is another one"):
        pull(str(parcel), sha256="0" * 64)
    with zipfile.ZipFile(parcel, "a") as archive:
        archive.writestr("../escaped.txt", "x")
    with pytest.raises(FacesynthError, match="not a file of this model"):
        pull(str(parcel))
    arrays = (source / "arrays.npz").read_bytes()
    forged = repacked(source, tmp_path / f"forged{SUFFIX}", {"arrays.npz": arrays[:-1] + bytes([arrays[-1] ^ 1])})
    with pytest.raises(FacesynthError, match="does not have the hash"):
        pull(str(forged))
    assert not list((tmp_path / "cache").rglob("actor")) + list((tmp_path / "cache").rglob("forged"))
    assert not (tmp_path / "escaped.txt").exists()


def repacked(folder, target, changes):
    with zipfile.ZipFile(target, "w") as archive:
        for path in folder.iterdir():
            archive.writestr(path.name, changes.get(path.name, path.read_bytes()))
    return target


@pytest.mark.parametrize("content", [b"", b"a page that says 404", b"PK\x03\x04 cut off"])
def test_what_is_no_parcel_is_one_clear_line(tmp_path, own_cache, content):
    (tmp_path / f"a{SUFFIX}").write_bytes(content)
    with pytest.raises(FacesynthError, match="damaged or no parcel"):
        pull(str(tmp_path / f"a{SUFFIX}"))
    with pytest.raises(FacesynthError, match="did not arrive"):
        pull((tmp_path / f"absent{SUFFIX}").as_uri())
    with pytest.raises(FacesynthError, match="https://"):
        pull("ftp://somewhere/a.zip")


def test_a_card_is_read_as_it_was_written_and_needs_a_licence(tmp_path):
    card = draft("a model", {"performer": "Ä", "licences": ["CC0", ""], "consents": []})
    assert (card.licence, card.consent) == ("CC0", "unknown")
    write_card(tmp_path / CARD, card)
    assert read_card(tmp_path / CARD) == card
    stated = yaml.safe_load((tmp_path / CARD).read_text())
    for change, said in (({"licence": None}, "needs licence"), ({"licens": "x"}, "did you mean licence")):
        with pytest.raises(FacesynthError, match=said):
            card_of({**stated, **change})
    del stated["licence"]
    with pytest.raises(FacesynthError, match="lacks licence"):
        card_of(stated)
    with pytest.raises(FacesynthError, match="needs consent"):
        Card("t", "p", ("en",), "CC0", " ")


def test_what_is_listed_is_what_speaks(capsys, monkeypatch):
    from facesynth.cli import run
    from facesynth.cli.models import models

    run(models, ["--json"])
    listed = json.loads(capsys.readouterr().out)
    assert DEFAULT in [one["name"] for one in listed]
    assert {one["part"] for one in listed} >= {"mouth", "head", "eyes", "expression"}


def test_the_doctor_names_what_is_missing(own_cache):
    done = without_torch("doctor")
    assert done.returncode == 0, done.stderr
    assert "pip install 'facesynth[train]'" in done.stdout
    assert "facesynth fetch landmarks" in done.stdout
