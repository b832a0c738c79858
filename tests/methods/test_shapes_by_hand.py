"""A face that talks though nobody was recorded."""

import csv

import numpy as np
import pytest
from click.testing import CliRunner

from facesynth.cli.train import train
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import PHONE_INDEX, VISEME_CLASSES
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.coarticulation.by_hand import SHIPPED, common_weights, from_table, read_shapes
from facesynth.methods.registry import load
from facesynth.motion.arkit_names import ARKIT_NAMES


def saying(*pairs):
    track = PhoneTrack(tuple(p for p, _ in pairs), np.cumsum([length for _, length in pairs]))
    audio = np.zeros(round(track.duration_s * 16000), np.float32)
    return Speech(audio, 16000, track, EmotionTrack.constant("neutral", track.duration_s))


def table(path, rows=VISEME_CLASSES, channels=("open", "round"), weight=lambda row, channel: 0.1 * channel + 0.05 * row):
    """A CSV with a shape for each row of phones."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["phones", *channels])
        writer.writerows([" ".join(row), *(weight(k, c) for c in range(len(channels)))] for k, row in enumerate(rows))
    return path


def test_the_shipped_shapes_are_arkits_and_cover_every_phone():
    names, shapes = read_shapes(SHIPPED["arkit"])
    assert set(names) <= set(ARKIT_NAMES)
    assert shapes.shape == (len(PHONE_INDEX), len(names))
    jaw, close = shapes[:, names.index("jawOpen")], shapes[:, names.index("mouthClose")]
    assert jaw[PHONE_INDEX["aa"]] > 2 * jaw[PHONE_INDEX["s"]]
    assert close[PHONE_INDEX["m"]] > 0
    assert not shapes[PHONE_INDEX["pau"]].any()


def test_the_shipped_shapes_shut_the_lips_at_p_b_and_m_and_open_them_in_vowels(rig):
    from facesynth.evaluation.lips import lip_opening

    motion = from_table("arkit", {}).synthesize(saying(("pau", 0.3), ("aa", 0.15), ("m", 0.08), ("aa", 0.15), ("pau", 0.3)))
    opening = lip_opening(motion)
    bounds = np.round(np.cumsum([0.3, 0.15, 0.08, 0.15]) * motion.fps).astype(int)
    assert opening[bounds[1] : bounds[2]].min() < 0.5
    assert opening[bounds[0] : bounds[1]].max() > 6
    assert opening[-1] < 0.5


def test_the_common_weights_lead_from_one_shape_to_the_next():
    weights = common_weights().diphones[3, 5]
    start, end = (np.vander([t], 4, increasing=True) @ weights.T for t in (0, 1))
    assert start[0] == pytest.approx([1, 0], abs=0.02)
    assert end[0] == pytest.approx([0, 1], abs=0.02)


def test_any_rig_is_moved_between_the_shapes_it_was_given(tmp_path):
    model = from_table(str(table(tmp_path / "mine.csv")), {})
    motion = model.synthesize(saying(("pau", 0.3), ("m", 0.3), ("uw", 0.3), ("pau", 0.3)))
    assert motion.layout.names == ("open", "round")
    assert motion.frames[round(0.45 * 60), 0] == pytest.approx(0.05 * 4, abs=0.02)
    assert motion.frames[round(0.75 * 60)] == pytest.approx([0.05 * 14, 0.1 + 0.05 * 14], abs=0.05)


def test_phones_that_no_row_names_take_the_shape_of_their_class(tmp_path):
    firsts = [row[:1] for row in VISEME_CLASSES]
    names, shapes = read_shapes(table(tmp_path / "short.csv", [*firsts, ("iy",)]))
    assert names == ("open", "round")
    assert np.array_equal(shapes[PHONE_INDEX["p"]], shapes[PHONE_INDEX["b"]])
    assert not np.array_equal(shapes[PHONE_INDEX["iy"]], shapes[PHONE_INDEX["ao"]])


def test_a_saved_model_says_the_same(tmp_path):
    model, speech = from_table("arkit", {}), saying(("aa", 0.2), ("m", 0.1), ("iy", 0.2))
    model.save(tmp_path / "arkit.safetensors")
    assert np.array_equal(load(tmp_path / "arkit.safetensors").synthesize(speech).frames, model.synthesize(speech).frames)
    assert "CC BY 4.0" in load(tmp_path / "arkit.safetensors").provenance["licences"]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda rows: rows[:1], "no shape for pau"),
        (lambda rows: rows[:5] + rows[6:], "no shape for b.*add one for b p m"),
        (lambda rows: [*rows, ["b", "0", "0"]], "line 17: b has a shape already"),
        (lambda rows: [*rows, ["x", "0", "0"]], "line 17.*'x'"),
        (lambda rows: [*rows, ["", "0", "0"]], "line 17: which phones"),
        (lambda rows: [rows[0], [rows[1][0], "2", "0"], *rows[2:]], "line 2: open must be a weight from 0 to 1; got '2'"),
        (lambda rows: [rows[0], [rows[1][0], "much", "0"], *rows[2:]], "line 2: open must be a weight"),
        (lambda rows: [rows[0], rows[1][:2], *rows[2:]], "line 2: 2 cells, but 3 columns"),
        (lambda rows: [["shape", *rows[0][1:]], *rows[1:]], "wanted a column phones"),
        (lambda rows: [], "wanted a column phones"),
    ],
)
def test_tables_that_cannot_be_used_are_refused_in_one_line(tmp_path, change, word):
    path = table(tmp_path / "odd.csv")
    with path.open(newline="") as file:
        rows = change(list(csv.reader(file)))
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    with pytest.raises(FacesynthError, match=word) as told:
        from_table(str(path), {})
    assert "\n" not in str(told.value)


def test_a_missing_table_and_a_setting_are_refused(tmp_path):
    with pytest.raises(FacesynthError, match="cannot be read as a table"):
        from_table(str(tmp_path / "none.csv"), {})
    with pytest.raises(FacesynthError, match="leave out the setting 'degree'"):
        from_table("arkit", {"degree": 2})


def test_the_command_makes_a_model_of_shapes_and_says_which_methods_take_one(tmp_path):
    path = tmp_path / "model.safetensors"
    done = CliRunner().invoke(train, ["coarticulation", "arkit", "-o", str(path)], catch_exceptions=False)
    assert "of shapes by hand" in done.output
    assert load(path).layout.kind == "curves"
    refused = CliRunner().invoke(train, ["ridge", str(table(tmp_path / "mine.csv"))])
    assert "coarticulation takes one" in str(refused.exception)
