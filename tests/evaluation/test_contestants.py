import pytest

from facesynth.evaluation.contestants import Contestant, by_minutes, check_labels, contestant, read_family, references
from facesynth.inference.errors import FacesynthError
from facesynth.methods.lds.method import LDS


def test_a_method_by_name_or_by_settings_file(repository):
    assert contestant("ridge") == Contestant("ridge", "ridge")
    published = contestant(f"efase:{repository / 'configs' / 'efase_published.yaml'}")
    assert (published.label, published.method) == ("efase_published", "efase")
    assert published.settings["alpha"] == 3.6052
    with pytest.raises(FacesynthError, match="efase"):
        contestant("efas")
    with pytest.raises(FacesynthError, match="cannot read settings"):
        contestant("efase:nowhere.yaml")
    check_labels([*references(), published])


def test_what_decides_the_predictions_includes_defaults():
    assert Contestant("a", "lds").plain()["settings"]["features"] == LDS().config["features"]
    assert Contestant("a", "lds", {"features": 4}).plain() != Contestant("a", "lds").plain()
    assert Contestant("a", "lds", speak={"noise": 0}).plain() != Contestant("a", "lds").plain()


def test_each_method_learns_again_from_fewer_minutes():
    families, variants = by_minutes([contestant("lds"), *references()], [5, 1, 5])
    assert families[0].labels == ("lds 1 min", "lds 5 min")
    assert families[0].values == (1, 5)
    assert len(families) == 1 + len(references())
    assert [one.minutes for one in variants[:2]] == [1, 5]
    check_labels([contestant("lds"), *references(), *variants])
    assert by_minutes([contestant("lds")], []) == ([], [])


def test_every_shipped_family_is_sound(repository):
    files = sorted((repository / "configs" / "ablations").glob("*.yaml"))
    assert {"efase_terms", "efase_components", "efase_minutes", "anime_graph_help", "anime_graph_widths", "lds_orders"} <= {
        path.stem for path in files
    }
    for path in files:
        family, variants = read_family(path)
        assert len(variants) > 1
        assert family.labels == tuple(one.label for one in variants)
        assert len({repr(one.plain()) for one in variants}) == len(variants)
        assert len(family.values) in (0, len(variants))


def test_each_term_of_the_cost_is_left_out_once(repository):
    _, variants = read_family(repository / "configs" / "ablations" / "efase_terms.yaml")
    zeros = [[k for k in ("alpha", "beta", "eta", "gamma", "delta", "phi") if one.settings[k] == 0] for one in variants]
    assert zeros == [[], ["alpha"], ["beta"], ["eta"], ["gamma"], ["delta"], ["phi"], []]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("title: t\nmethod: ridge\nvariant: {}\n", "needs title, method and variants"),
        ("title: t\nmethod: ridge\nvariants: {a: {}}\naxes: x\n", "did you mean axis"),
        ("title: t\nmethod: efase\nvariants: {a: {componets: 3}}\n", "components"),
        ("title: t\nmethod: ridge\nvariants: {a: {}}\naxis: minutes\n", "no number for the axis"),
        ("- a\n", "needs title"),
        ("a: [", "cannot read"),
    ],
)
def test_other_files_are_refused(tmp_path, text, why):
    (tmp_path / "f.yaml").write_text(text)
    with pytest.raises(FacesynthError, match=why):
        read_family(tmp_path / "f.yaml")
