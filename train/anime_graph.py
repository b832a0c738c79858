"""Build an anime graph from a corpus, speak its held-out sentences, judge its emotion maps, save the model.

python train/anime_graph.py CORPUS -o anime_graph.safetensors [--maps 20] [--config configs/anime_graph.yaml] [variance=0.98 …]

learn=true (as in configs/anime_graph_soft.yaml) learns the weights of the cost and how much to sharpen by gradient through
the mean over paths, on sentences of CORPUS that are kept out of the graph meanwhile; those held out here play no part.
"""

from itertools import permutations
from pathlib import Path

from facesynth.config import settings_of, training_parser
from facesynth.corpus import Corpus
from facesynth.evaluation.geometry import lve, marker_error
from facesynth.inference.errors import FacesynthError
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.anime_graph.parallel import take_of
from facesynth.methods.anime_graph.report import MapTrial, learner
from facesynth.methods.training import train

CONFIG = Path(__file__).parents[1] / "configs" / "anime_graph.yaml"


def main() -> None:
    parser = training_parser(__doc__, CONFIG)
    parser.add_argument("--maps", type=int, metavar="N", help="leave each of N parallel sentences out and map it, for every pair")
    options = parser.parse_intermixed_args()

    # load
    corpus = Corpus.open(options.corpus)
    learn, held_out = corpus.split(options.seed)

    # fit
    model = train(AnimeGraph, learn, settings_of(options), seed=options.seed, device=options.device)
    if told := model.facts.get("learned"):
        print(f"learned in {told['rounds']} rounds, validation error {told['improvement']:.1%} less")
        print(" ".join(f"{name}={value:.4g}" for name, value in told["settings"].items()))
    print(f"{len(learn)} utterances, {len(model.graph)} nodes, {model.components.count} components")
    for row, cutoff_hz in zip(model.facts["components"], model.cutoffs_hz.tolist(), strict=False):
        print(f"  component {row['component']:2d} ({row['block']}): {row['is']}, emotion ratio {row['emotion_ratio']:.2f}, "
              f"false discovery {row['false_discovery']:.3f}, "
              f"mouth share {row['mouth_share']:.3f}, cut-off {cutoff_hz:.1f} Hz")  # fmt: skip

    for sentence in model.facts["findings"]:
        print(sentence)

    # evaluate: sentences it has not seen
    unit = corpus.layout.unit
    for utterance in held_out:
        made, plan = model.synthesize(utterance.speech), model.plan(utterance.speech)
        print(f"{utterance.id}: marker error {marker_error(made, utterance.motion):.3f} {unit}, "
              f"{_lips(made, utterance.motion)}{plan.jumps.sum()} jumps in {len(plan.path)} phones")  # fmt: skip

    # evaluate: emotions on sentences left out
    if options.maps:
        report_maps(model, corpus, options.maps)

    # save
    model.save(options.output)
    print(f"saved {options.output}")


def _lips(made, truth) -> str:  # type: ignore[no-untyped-def]
    has_lips = "mouth" in truth.layout.groups and truth.layout.dimension > 1
    return f"lips {lve(made, truth):.3f} {truth.layout.unit}, " if has_lips else ""


def report_maps(model: AnimeGraph, corpus: Corpus, most: int) -> None:
    """Unit-cube RMS of every ordered pair, and how it falls with the number of parallel sentences."""
    takes = [take for take in (take_of(u, model.components) for u in corpus) if take is not None]
    learn = learner(corpus.layout, variance=model.config["variance"], override=model.config["emotional_components"])
    trial = MapTrial(takes, corpus.layout, learn, model.map_settings.centres)
    few = trial.with_sentences(most)
    default = f"{model.map_settings.kernel} {model.map_settings.width}"
    for source, target in permutations(corpus.emotions, 2):
        try:
            score = few.score(source, target)
        except FacesynthError as error:
            print(error)
            continue
        widths = ", ".join(f"{name} {value:.5f}" for name, value in score.mapped.items())
        verdict = f"{default}: {'nearer' if score.helps(default) else 'NOT nearer'} than both"
        print(f"{source} to {target}, each of {score.sentences} sentences left out: unchanged {score.unchanged:.5f}, "
              f"mean difference {score.mean_difference:.5f}, {widths}; best: {score.best}; {verdict}", flush=True)  # fmt: skip
        curve = trial.learning_curve(source, target, model.map_settings)
        print("  by sentences learned from: " + ", ".join(f"{count}: {value:.5f}" for count, value in curve.items()), flush=True)


if __name__ == "__main__":
    main()
