"""How long a change takes until the moving face is there: search, a window of two seconds, its weights, and the whole.

    python benchmarks/editing.py MODEL CORPUS [--phones 30] [--changes 6]

Phones and sound are those of utterances of the corpus, joined until there are so many. Each kind of change is made at places
spread over the sentence, each time after the sentence was there as it was before: a constraint (another node of the same
phone), a node removed, a boundary, the emotion from there on, and an intensity of one half from there on. Shown are medians
and the worst, in seconds of the clock and, for a loaded machine, of the processor:

    search    the new path, from what is kept
    window    frames of the second before and the second after the change
    weights   the window again and its 52 weights of the built-in head, 30 frames a second (head and eyes are known)
    shown     search and weights: what an editor waits for
    whole     all frames of the sentence after that, as `synthesize` gives them
    anew      `synthesize` of the changed sentence, for comparison; `same` says whether its frames are equal to the byte
"""

import argparse
import time
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from facesynth.corpus import Corpus
from facesynth.corpus.journal import Edits
from facesynth.evaluation.papers.joined import joined
from facesynth.inference.speech import EmotionTrack, PhoneTrack
from facesynth.methods.registry import load
from facesynth.stage.cast import cast_for
from facesynth.stage.preview import Preview
from facesynth.stage.request import Request

STEPS = ("search", "window", "weights", "whole", "anew")


@dataclass
class Clock:
    """Seconds of the clock and of the processor, one row for each change."""

    rows: list

    def time(self, row, step, what):
        clock, processor = time.perf_counter(), time.process_time()
        result = what()
        row[step] = (time.perf_counter() - clock, time.process_time() - processor)
        return result


def constraint(model, speech, choices, place):
    node, phone = choices[place]["node"], speech.phones.labels[place]
    found = model.phone_map(phone, "pca").cluster
    same = [n for n, e in zip(found.names, found.emotions, strict=True) if e == choices[place]["emotion"] and n != node]
    return speech, {"constraints": {place: (same or found.names)[len(same) // 2]}}


def boundary(model, speech, choices, place):
    ends_s = speech.phones.ends_s.copy()
    after = ends_s[place + 1] if place + 1 < len(ends_s) else ends_s[place] + 0.1
    ends_s[place] += 0.4 * (after - ends_s[place])
    return replace(speech, phones=PhoneTrack(speech.phones.labels, ends_s)), {}


def emotion(model, speech, choices, place):
    felt = speech.emotions.labels[0]
    other = next(e for e in model.emotions if e != felt)
    return replace(speech, emotions=_from(speech, place, felt, other, 1.0)), {}


def intensity(model, speech, choices, place):
    felt = speech.emotions.labels[0]
    return replace(speech, emotions=_from(speech, place, felt, felt, 0.5)), {}


def _from(speech, place, before, after, amount):
    cut_s, end_s = float(speech.phones.starts_s[place]), speech.duration_s
    if cut_s <= 0:
        return EmotionTrack.constant(after, end_s, amount)
    return EmotionTrack((before, after), np.array([cut_s, end_s]), np.array([1.0, amount]))


def removal(model, speech, choices, place):
    return speech, {"edits": Edits(frozenset([choices[place]["node"]]), ())}


CHANGES = {"constraint": constraint, "removal": removal, "boundary": boundary, "emotion": emotion, "intensity": intensity}


def sentence(corpus, count):
    felt = [record.id for record in corpus.usable_records if record.emotion != "neutral"] or list(corpus.ids)
    return joined([corpus[name].speech for name in felt[:8]], count)


def measured(model, speech, change, places, clock):
    request = Request()
    preview = Preview(cast_for(model, request), request)
    now = preview.change(speech, request)
    now.animation(0, 0.1)
    choices = now.draft.choices()
    for place in places:
        preview.change(speech, request)
        new, own = change(model, speech, choices, place)
        asked, row, middle_s = replace(request, own=own), {}, float(speech.phones.ends_s[place])
        draft = clock.time(row, "search", lambda new=new, asked=asked: preview.change(new, asked))
        around = (max(middle_s - 1, 0), min(middle_s + 1, new.duration_s))
        clock.time(row, "window", lambda draft=draft, around=around: draft.draft.motion(*around))
        clock.time(row, "weights", lambda draft=draft, around=around: draft.animation(*around))
        whole = clock.time(row, "whole", draft.draft.motion)
        anew = clock.time(row, "anew", lambda new=new, own=own: model.synthesize(new, **own))
        row["same"] = whole.frames.tobytes() == anew.frames.tobytes()
        clock.rows.append(row)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("corpus")
    parser.add_argument("--phones", type=int, default=30)
    parser.add_argument("--changes", type=int, default=6, help="places of each kind of change")
    options = parser.parse_args()
    model, corpus = load(options.model), Corpus.open(options.corpus)
    speech = sentence(corpus, options.phones)
    spoken = [t for t, label in enumerate(speech.phones.labels[:-1]) if label != "pau"]
    places = [spoken[k] for k in np.linspace(0, len(spoken) - 1, options.changes).astype(int)]
    nodes = sum(len(model.phone_map(phone, "pca").cluster.names) for phone in model.mapped_phones())
    print(f"{model.name}, {nodes} nodes; {len(speech.phones)} phones, {speech.duration_s:.2f} s; seconds clock (processor)")
    with threadpool_limits(1):
        for name, change in CHANGES.items():
            clock = Clock([])
            measured(model, speech, change, places, clock)
            shown = np.array([np.sum([row[step] for step in ("search", "weights")], axis=0) for row in clock.rows])
            print(f"{name}: same {sum(row['same'] for row in clock.rows)} of {len(clock.rows)}", flush=True)
            print(f"  shown    median {_both(np.median(shown, axis=0))}, worst {_both(shown.max(axis=0))}")
            for step in STEPS:
                taken = np.array([row[step] for row in clock.rows])
                print(f"  {step:8s} median {_both(np.median(taken, axis=0))}, worst {_both(taken.max(axis=0))}")


def _both(seconds):
    return f"{seconds[0]:.3f} ({seconds[1]:.3f})"


if __name__ == "__main__":
    main()
