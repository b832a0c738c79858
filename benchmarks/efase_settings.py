"""Settings of eFASE beside each other on clips that `facesynth tune` did not choose by, from larger databases than it searched.

    python benchmarks/efase_settings.py SETTINGS.yaml... --corpora CORPUS... --limit 100

The tested clips are those that `facesynth tune` tests on with the same --sentences, --test and --seed.
"""

import argparse
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np

from facesynth.config import load_config
from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve, marker_error
from facesynth.evaluation.lips import closure_rate, closure_threshold, require_parting
from facesynth.evaluation.pair import UnavailableError
from facesynth.inference.motion import Motion
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
    print("| corpus, nodes | settings | marker error | `lve` | energy ratio | closure rate |")
    print("|---|---|---:|---:|---:|---:|", flush=True)
    for path in asked.corpora:
        database, _, test = split_for_tuning(Corpus.open(path), asked.sentences, asked.test, asked.seed)
        count = min(asked.limit, len(database))
        model = Efase(maps=False).fit(database.subset([database.ids[i * len(database) // count] for i in range(count)]))
        changing = ChangingSettings(model)
        for settings in asked.settings:
            cells = figures(changing, load_config(settings), test)
            print(f"| {test.performer}, {len(model.nodes())} | {settings.stem} | {' | '.join(cells)} |", flush=True)


def figures(changing: ChangingSettings, settings: dict[str, float], test: Corpus) -> list[str]:
    """Means over the tested clips; a dash where a layout or its recordings do not tell."""
    speaker = changing.speaker({name: settings[name] for name in RANGES})
    pairs = [(speaker.synthesize(u.speech), u) for u in test]

    def mean(measure: Callable[[Motion, Utterance], float], some: Sequence[tuple[Motion, Utterance]] = pairs) -> str:
        known = []
        for made, u in some:
            with suppress(UnavailableError):
                known.append(measure(made, u))
        return f"{np.mean(known):.3g}" if known else "—"

    def shut(made: Motion, u: Utterance) -> float:
        threshold = closure_threshold((one.motion, one.speech.phones) for _, one in pairs)
        require_parting((one.motion for _, one in pairs), threshold)
        return closure_rate(made, u.speech.phones, threshold)

    plain = [partial(compared, measure) for measure in (marker_error, lve, energy_ratio)]
    return [*map(mean, plain), mean(shut, [pair for pair in pairs if {"p", "b", "m"} & set(pair[1].speech.phones.labels)])]


def compared(measure: Callable[[Motion, Motion], float], made: Motion, utterance: Utterance) -> float:
    """A figure of two motions, the recorded one being the utterance's."""
    return measure(made, utterance.motion)


if __name__ == "__main__":
    main()
