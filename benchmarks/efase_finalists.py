"""The best settings that `facesynth tune` tried, on sentences that it neither learned from, chose by nor tests on.

    python benchmarks/efase_finalists.py TUNED.jsonl CORPUS... --limit 70 --sentences 12 --test 20 [--finalists 12] [--more 40]
        [--on CORPUS...]

A search that tries hundreds of settings on a dozen sentences finds some that only suit these. CORPUS, --limit, --sentences,
--test and --seed are those of the search, so the databases are the same. Prints, for each corpus, the error over that of the
settings that the search started from, on the sentences that were searched on and on the others; and the finalist that stands best
on the others. --on: try them on these corpora alone.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import yaml

from facesynth.corpus import Corpus
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.tuning import PUBLISHED, RANGES, some_of, split_for_tuning, standing
from facesynth.methods.efase.tuning_search import ChangingSettings, examples_of, sentence_errors

Settings = dict[str, float]


def main() -> None:
    """Print a table, and the settings that stand best."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("journal", type=Path)
    parser.add_argument("corpora", type=Path, nargs="+")
    parser.add_argument("--limit", type=int, default=70, help="utterances of each database, evenly chosen")
    parser.add_argument("--sentences", type=int, default=12, help="of each corpus, that were searched on")
    parser.add_argument("--test", type=int, default=20, help="of each corpus, that are tested on")
    parser.add_argument("--finalists", type=int, default=12)
    parser.add_argument("--more", type=int, default=40, help="other sentences of each corpus, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--on", type=Path, nargs="+", help="corpora; all unless given")
    asked = parser.parse_args()
    places = [asked.corpora.index(path) for path in asked.on or asked.corpora]
    own, searched = ratios_searched([Corpus.open(path).performer for path in asked.corpora], asked.journal)
    finalists = [settings for settings, _ in searched[: asked.finalists]]
    columns = [errors_on_others(asked.corpora[place], [own, PUBLISHED, *finalists], asked) for place in places]
    others = np.transpose(columns) / np.transpose(columns)[0]
    print(
        "| | "
        + " | ".join(f"{path.name}, searched on | others" for path in asked.on or asked.corpora)
        + " | standing on others |"
    )
    print("|---|" + "---:|" * (2 * len(columns) + 1))
    before = [[None] * len(columns)] * 2 + [[ratios[place] for place in places] for _, ratios in searched]
    for number, (known, ratios) in enumerate(zip(before, others, strict=False)):
        name = ("start", "published", *(f"finalist {k + 1}" for k in range(len(finalists))))[number]
        cells = [f"{'' if k is None else f'{k:.3f}'} | {r:.3f}" for k, r in zip(known, ratios, strict=True)]
        print(f"| {name} | {' | '.join(cells)} | {standing(ratios):.3f} |")
    best = finalists[int(np.argmin([standing(ratios) for ratios in others[2:]]))]
    print("\n" + yaml.safe_dump({name: float(f"{best[name]:.4g}") for name in RANGES}, sort_keys=False))


def ratios_searched(performers: list[str], journal: Path) -> tuple[Settings, list[tuple[Settings, list[float]]]]:
    """What a search started from; and what was tried on all corpora, best first, with its errors over those of the start."""
    tried: dict[str, dict[str, float]] = {}
    for line in journal.read_text(encoding="utf-8").splitlines()[1:]:
        row = json.loads(line)
        performer, settings = json.loads(row["key"])
        tried.setdefault(json.dumps(settings), {})[performer] = row["error"]
    own, start = next(iter(tried.items()))  # the models' own settings are tried before all others
    whole = [
        (json.loads(settings), [errors[one] / start[one] for one in performers])
        for settings, errors in tried.items()
        if len(errors) == len(performers)
    ]
    return json.loads(own), sorted(whole, key=lambda one: standing(one[1]))


def errors_on_others(path: Path, settings: list[Settings], asked: argparse.Namespace) -> list[float]:
    """The mean error of each of the settings on sentences of a corpus that had no part in the search."""
    rest, _, _ = split_for_tuning(Corpus.open(path), asked.sentences, asked.test, asked.seed)
    database = some_of(rest, asked.limit)
    known = {rest.record(name).sentence_key for name in database.ids}
    others = rest.subset([name for name in rest.ids if rest.record(name).sentence_key not in known])
    model = Efase(maps=False).fit(database, seed=asked.seed)
    changing, examples = ChangingSettings(model), examples_of(model, some_of(others, asked.more))
    return [float(np.mean(sentence_errors(changing.speaker(one), examples))) for one in settings]


if __name__ == "__main__":
    main()
