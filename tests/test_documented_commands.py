"""Commands that README.md and docs/ name: verbs, options, settings, scripts and files of settings are there."""

import re
import shlex
from pathlib import Path

import click
import pytest

from facesynth.cli import cli
from facesynth.methods.registry import create, list_methods

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
OWN = ("benchmarks", "train", "export", "examples")


def commands(page):
    """Those of a page: lines of its blocks, and what stands between backticks in a sentence."""
    blocks = re.findall(r"^```[a-z]*\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    sentences = re.sub(r"^```.*?^```", "", page, flags=re.DOTALL | re.MULTILINE)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines() + re.findall(r"`((?:facesynth|python) [^`]+)`", sentences)
    for line in lines:
        words = words_of(line.strip())
        if words and words[0] in ("facesynth", "python"):
            yield words


def words_of(line):
    try:
        return shlex.split(line, comments=True)
    except ValueError:
        return []


def wrong_with(words):
    """What of a command is not there; empty where all is."""
    return wrong_with_verb(words[1:]) if words[0] == "facesynth" else wrong_with_script(words[1:])


def wrong_with_verb(words):
    at = cli
    while isinstance(at, click.Group) and words and not words[0].startswith("-"):
        verb, words = words[0], words[1:]
        if (found := at.get_command(click.Context(at), verb)) is None:
            return [] if re.fullmatch(r"[A-Z|…\d]+|\w+(\|\w+)+", verb) else [f"no verb {verb!r}"]
        at = found
    known = {name for one in at.get_params(click.Context(at)) for name in (*one.opts, *one.secondary_opts)}
    wrong = [f"no option {word}" for word in options(words) if word not in known]
    return wrong + wrong_settings(words if at.name == "train" else []) + wrong_files(words)


def wrong_settings(words):
    """Settings that the named method does not have; of the one that `train CORPUS` trains where none is named."""
    method = next((word for word in words if word in list_methods()), "efase")
    keys = [word.partition("=")[0] for word in words if re.fullmatch(r"[a-z_]+=\S+", word)]
    known = create(method).config if "emotion" not in words else keys
    return [f"{method} has no setting {key!r}" for key in keys if key not in known]


def wrong_files(words):
    """Files of settings that facesynth has not."""
    named = re.findall(r"configs/[\w/]+\.yaml", " ".join(words))
    return [f"no file {name}" for name in named if not (ROOT / name).is_file()]


def wrong_with_script(words):
    if not words or not words[0].endswith(".py") or not words[0].startswith(OWN):
        return []
    if not (ROOT / words[0]).is_file():
        return [f"no script {words[0]}"]
    source = text_of(ROOT / words[0])
    return [f"{words[0]} has no option {word}" for word in options(words) if f'"{word}"' not in source] + wrong_files(words)


def text_of(script):
    """A script with those beside it that it imports, and the modules of facesynth whose options it shares."""
    source = script.read_text(encoding="utf-8")
    beside = {path.stem: path for path in script.parent.glob("*.py") if path != script}
    imported = [beside[name] for name in re.findall(r"^from (\w+) import", source, re.MULTILINE) if name in beside]
    shared = [ROOT / "facesynth" / name for name in ("config.py", "cli/export.py") if module(name) in source]
    return source + "".join(path.read_text(encoding="utf-8") for path in imported + shared)


def module(name):
    return f"facesynth.{name.removesuffix('.py').replace('/', '.')}"


def options(words):
    return [word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_what_a_page_says_to_type_exists(page):
    found = {" ".join(words): wrong for words in commands(page.read_text(encoding="utf-8")) if (wrong := wrong_with(words))}
    assert not found


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        ("facesynth evaluate GRID efase:configs/efase.yaml --folds 5 -o report/", []),
        ("facesynth evaluate GRID efase:configs/nowhere.yaml --fold 5", ["no option --fold", "no file configs/nowhere.yaml"]),
        ("facesynth train efase actor/ candidates=7", []),
        ("facesynth train actor/ candidate=7", ["efase has no setting 'candidate'"]),
        ("facesynth corpus mend actor/", ["no verb 'mend'"]),
        ("python benchmarks/frontier.py GRID -o frontier/ --join", []),
        ("python benchmarks/frontier.py GRID --joined", ["benchmarks/frontier.py has no option --joined"]),
        ("python benchmarks/nothing.py GRID", ["no script benchmarks/nothing.py"]),
    ],
)
def test_what_is_not_there_is_seen(line, wrong):
    assert wrong_with(words_of(line)) == wrong
