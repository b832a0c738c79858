"""Settings of eFASE beside each other on clips that `facesynth tune` did not choose by, from a larger database than it searched on.

    python benchmarks/efase_settings.py SETTINGS.yaml... --corpora CORPUS... --limit 100

The tested clips are those that `facesynth tune` tests on with the same --sentences, --test and --seed.
"""

import argparse
from pathlib import Path

import numpy as np

from facesynth.config import load_config
from facesynth.corpus import Corpus
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve, marker_error
from facesynth.evaluation.lips import closure_rate, closure_threshold, require_parting
from facesynth.evaluation.pair import UnavailableError
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.tuning import RANGES, split_for_tuning
from facesynth.methods.efase.tuning_search import ChangingSettings


def main() -> None:
    """Print a table, a row for each corpus and settings file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("settings", type=Path, nargs="+")
    parser.add_argument("--corpora", type=Path, nargs="+", required=True)
    parser.add_argument("--limit", type=int, default=100, help="utterances of the database, evenly chosen")
    parser.add_argument("--sentences", type=int, default=10)
    parser.add_argument("--test", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    print(
        "| corpus, nodes | settings | marker error | `lve` | closure rate | energy ratio |\n|---|---|---:|---:|---:|---:|",
        flush=True,
    )
    for path in asked.corpora:
        database, _, test = split_for_tuning(Corpus.open(path), asked.sentences, asked.test, asked.seed)
        count = min(asked.limit, len(database))
        model = Efase(maps=False).fit(database.subset([database.ids[i * len(database) // count] for i in range(count)]))
        changing = ChangingSettings(model)
        for settings in asked.settings:
            cells = figures(changing, load_config(settings), test)
            print(f"| {test.performer}, {len(model.nodes())} | {settings.stem} | {' | '.join(cells)} |", flush=True)


def figures(changing: ChangingSettings, settings: dict[str, float], test: Corpus) -> list[str]:
    """Means over the tested clips."""
    speaker = changing.speaker({name: settings[name] for name in RANGES})
    pairs = [(speaker.synthesize(u.speech), u) for u in test]
    shut = "—"
    try:
        threshold = closure_threshold((u.motion, u.speech.phones) for _, u in pairs)
        require_parting((u.motion for _, u in pairs), threshold)
        shut = f"{np.mean([closure_rate(made, u.speech.phones, threshold) for made, u in pairs if says_closure(u)]):.2f}"
    except UnavailableError:
        pass
    errors = [np.mean([measure(made, u.motion) for made, u in pairs]) for measure in (marker_error, lve, energy_ratio)]
    return [f"{errors[0]:.3f}", f"{errors[1]:.2f}", shut, f"{errors[2]:.2f}"]


def says_closure(utterance) -> bool:
    """Whether a p, b or m is said."""
    return bool({"p", "b", "m"} & set(utterance.speech.phones.labels))


if __name__ == "__main__":
    main()
