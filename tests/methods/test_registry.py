"""Methods by what they can do, ours and those of other packages."""

import inspect
import subprocess
import sys
from pathlib import Path
from pkgutil import resolve_name

import pytest
from click.testing import CliRunner

from facesynth.cli.speak import speak
from facesynth.inference.errors import FacesynthError
from facesynth.methods import capabilities as abilities
from facesynth.methods.registry import (
    DEFAULT,
    able,
    capabilities_of,
    create,
    known_capabilities,
    list_methods,
    method_class,
    require,
    require_option,
)


@pytest.fixture
def packages(tmp_path, monkeypatch):
    """Installs made-up packages: (name of the method, what the entry point names, its code)."""
    monkeypatch.syspath_prepend(tmp_path)

    def install(method, reference, code):
        module = reference.partition(":")[0]
        (tmp_path / f"{module}.py").write_text(code, encoding="utf-8")
        info = tmp_path / f"{module}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n", encoding="utf-8")
        (info / "entry_points.txt").write_text(f"[facesynth.methods]\n{method} = {reference}\n", encoding="utf-8")

    return install


@pytest.mark.parametrize("name", list_methods())
def test_a_method_can_do_what_it_states_and_no_more(name):
    stated, cls = capabilities_of(name), method_class(name)
    assert cls.capabilities is stated
    assert stated.summary
    for ability in abilities.WORDS:
        assert issubclass(cls, ability) == (ability in stated.abilities), ability
    keywords = inspect.signature(cls.synthesize).parameters
    for option in stated.options:
        assert keywords[option.name].kind is inspect.Parameter.KEYWORD_ONLY
        assert not option.reader or callable(resolve_name(option.reader))
    for reference in (stated.exporter, stated.tuner):
        assert not reference or callable(resolve_name(reference))


def test_asking_what_all_can_do_imports_no_torch():
    code = "import sys; from facesynth.methods.registry import *; list_methods(); known_capabilities(); needs()"
    code += "; print(DEFAULT in list_methods(), 'torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=1800)
    assert done.stdout.split() == ["True", "False"]


def test_what_a_method_lacks_is_told_with_those_that_have_it():
    model = create("mean_face")
    with pytest.raises(FacesynthError, match="mean_face tells nothing of its choices; anime_graph and efase explain them"):
        require(model, abilities.Explaining)
    with pytest.raises(FacesynthError, match="mean_face has no option --look-ahead; it is one of anime_graph"):
        require_option(model, "look_ahead")
    assert require(create("anime_graph"), abilities.MappingEmotions).config
    assert able(abilities.Streaming) == ["anime_graph"]


def test_names_of_other_packages_are_listed_without_importing_them(packages):
    packages("echo", "echoing:CAPABILITIES", "raise RuntimeError('somebody imported me')")
    assert "echo" in list_methods()
    assert "echoing" not in sys.modules


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("1 / 0", "ZeroDivisionError"),
        ("OTHER = 3", "CAPABILITIES"),
        ("CAPABILITIES = 3", "must name the Capabilities of broken; got 3"),
        (
            "from facesynth.methods.capabilities import Capabilities\nCAPABILITIES = Capabilities('other')",
            "must name the Capabilities of broken",
        ),
    ],
)
def test_a_broken_package_is_told_in_one_line_and_does_not_break_the_others(packages, request, code, message):
    module = f"broken_{request.node.callspec.indices['code']}"
    packages("broken", f"{module}:CAPABILITIES", code)
    known, broken = known_capabilities()
    assert {one.name for one in known} >= {"mean_face", DEFAULT}
    assert len(broken) == 1
    assert message in broken[0]
    assert f"of the package {module}" in broken[0]
    assert "\n" not in broken[0]
    with pytest.raises(FacesynthError, match="broken = "):
        create("broken")
    assert create("mean_face").config == {}


def test_a_class_that_is_not_registered_where_it_is_said_to_be(packages):
    code = "from facesynth.methods.capabilities import Capabilities\nHERE = Capabilities('nobody', home='nobodys')"
    packages("nobody", "nobodys:HERE", code)
    with pytest.raises(FacesynthError, match="nobodys registers no method 'nobody'"):
        create("nobody")


def test_a_name_of_ours_cannot_be_taken_over(packages):
    packages("mean_face", "thief:CAPABILITIES", "raise RuntimeError")
    assert create("mean_face").name == "mean_face"
    assert ["thief is left out: mean_face is one of facesynth's own" in line for line in known_capabilities()[1]] == [True]
    assert Path(inspect.getfile(method_class("mean_face"))).stem == "mean_face"


def test_options_are_called_as_no_option_of_every_model_and_mean_one_kind_of_value():
    options, left_out = speak.options_of_methods()
    assert left_out == []
    for name in list_methods():
        for option in capabilities_of(name).options:
            assert options[option.name].type is option.type, f"{name} takes {option.flag} otherwise than another method"


def test_an_option_that_is_taken_is_left_out_of_the_new_method_and_stays_with_the_others(packages):
    code = "from facesynth.methods.capabilities import Capabilities, Option\n"
    code += "HERE = Capabilities('greedy', options=(Option('seed', str, ''), Option('noise', str, ''), Option('zest', int, '')))"
    packages("greedy", "greedily:HERE", code)
    options, left_out = speak.options_of_methods()
    assert (options["noise"].type, options["zest"].type, "seed" in options) == (float, int, False)
    assert left_out == [
        "greedy: --seed is an option of every model and is left out; call it otherwise",
        "greedy takes --noise as a str, but lds as a float: it is left out; call it otherwise",
    ]
    assert speak.taken_apart({"seed": 3, "noise": 0.5, "zest": None}) == ({"seed": 3}, {"noise": 0.5})
    said = CliRunner().invoke(speak, ["--help"]).output
    assert "--zest INTEGER" in said
    assert "None" not in said
