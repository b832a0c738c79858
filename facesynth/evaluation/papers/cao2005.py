"""Cao, Tien, Faloutsos and Pighin 2005."""

from facesynth.evaluation.cost import stopwatch
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.finding import Finding, not_available, values
from facesynth.evaluation.papers.joined import joined, phones_until
from facesynth.inference.errors import FacesynthError
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.anime_graph.parallel import take_of
from facesynth.methods.anime_graph.report import MapTrial
from facesynth.methods.emotion.clips import clips_of_corpus
from facesynth.methods.emotion.tables import COEFFICIENTS, Recognition, Split, table_one

TABLE: dict[tuple[Split, str], tuple[float, ...]] = {
    ("train = test", "linear"): (94.06, 99.17, 100.0, 100.0),
    ("train = test", "radial"): (91.29, 96.40, 95.71, 96.27),
    ("random halves", "linear"): (88.95, 94.75, 96.96, 99.17),
    ("random halves", "radial"): (85.63, 91.43, 90.88, 91.16),
}
"""Table I: per cent recognised by 50, 100, 500, 1000 coefficients."""
MAP_ERROR = 0.0117
LONGEST_S = 62


def findings(material: Material) -> list[Finding]:
    """Tables and figures of the paper."""
    model = AnimeGraph().fit(material.train, seed=material.seed)
    return [*recognition(material), *mapping(material, model), *graph(material, model)]


def recognition(material: Material) -> list[Finding]:
    """Table I, and the same by sentence, which the paper does not report."""
    where, what = "table I", f"emotions recognised from speech by {values(COEFFICIENTS, '{:.0f}')} coefficients"
    emotions = {record.emotion for record in material.train.usable_records}
    if len(emotions) < 2:
        return [not_available(where, what, "95 to 100 %", "the recordings have a single emotion")]
    rows = table_one(clips_of_corpus(material.train))
    return [_recognition(rows, split, kernel, what, len(emotions)) for split, kernel in _kinds(rows)]


def _kinds(rows: list[Recognition]) -> list[tuple[Split, str]]:
    return list(dict.fromkeys((row.split, row.settings.kernel) for row in rows))


def _recognition(rows: list[Recognition], split: Split, kernel: str, what: str, emotions: int) -> Finding:
    mine = [row.accuracy * 100 for row in rows if (row.split, row.settings.kernel) == (split, kernel)]
    known = TABLE.get((split, kernel))
    why = f"another voice, {emotions} emotions in place of 5" + ("" if known else "; the paper does not report it")
    paper = values(known, "{:.1f} %") if known else "—"
    return Finding("table I", f"{what}, {kernel} kernel, {split}", paper, values(mine, "{:.1f} %"), False, why)


def mapping(material: Material, model: AnimeGraph) -> list[Finding]:
    """§5.2: neutral to happy, each sentence left out in turn or in ten groups; by kernel and width."""
    where, what = "§5.2", "emotion map on a sentence left out, unit-cube RMS"
    pair = ("neutral", "happy")
    try:
        takes = [take for u in material.train if (take := take_of(u, model.components)) is not None]
        trial = MapTrial(takes, model.split, model.components, material.corpus.layout)
        score = trial.score(*pair, seed=material.seed)
    except FacesynthError as reason:
        return [not_available(where, what, str(MAP_ERROR), str(reason))]
    why = f"one sentence there, mean of {score.sentences} here; {material.unlike}; what doing nothing scores is not said there"
    rows = {"unchanged motion": score.unchanged, "mean difference": score.mean_difference, **score.mapped}
    return [
        Finding(where, f"{what}, {name}", str(MAP_ERROR) if name in score.mapped else "—", f"{error:.4f}", False, why)
        for name, error in rows.items()
    ]


def graph(material: Material, model: AnimeGraph) -> list[Finding]:
    """§3 and §8: sizes."""
    minutes = sum(material.train.duration_s(i) for i in material.train.ids) / 60
    phones = sum(label != "pau" for u in material.train for label in u.speech.phones.labels)
    return [
        Finding("§3", "minutes of recordings", "53", f"{minutes:.1f}", False, "another corpus"),
        Finding("§4.1", "nodes of the graph", "about 10,000", str(phones), False, "another corpus"),
        longest(material, model),
        not_available("figs 7 to 10", "pictures of frames", "pictures", "no number is given; a report's videos show frames"),
    ]


def longest(material: Material, model: AnimeGraph) -> Finding:
    """§8: as long a speech as theirs, tested utterances one after the other."""
    said = [utterance.speech for utterance in material.test]
    speech = joined(said, phones_until(said, LONGEST_S))
    model.synthesize(said[0])
    with stopwatch() as spent:
        motion = model.synthesize(speech)
    ours = f"{motion.duration_s:.0f} ({len(speech.phones)} phones), made in {spent.clock_s:.1f} s"
    why = "tested utterances one after the other; the paper tells no time"
    return Finding("§8", "longest speech synthesised, s", f"{LONGEST_S}", ours, False, why)
