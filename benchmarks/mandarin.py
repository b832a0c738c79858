"""Closures heard in Mandarin against curves: `python benchmarks/mandarin.py FOLDER --texts TEXTS`.

FOLDER holds NAME.wav, NAME.npz (`weights` [T, C], `fps`) and channels.txt; TEXTS what is said in each, NAME.txt. Closures of the
curves are peaks of the channels that press the lips together; those of the sound are p, b and m. One belongs to one where they
lie within 60 or 100 ms. Takes whose curves never press the lips are left out and named.
"""

import argparse
from pathlib import Path

import numpy as np
import phones
import torch
from phones import closures, met
from scipy.signal import find_peaks

from facesynth.speech.audio import load_audio
from facesynth.speech.decoder_recognition import recognise_by_decoder
from facesynth.speech.phone_sources import find_phones

PRESSED = ("mouth_press_l", "mouth_press_r")
LEAST, APART = 0.04, 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--texts", type=Path, required=True)
    parser.add_argument("--pocketsphinx", action="store_true", help="also what was heard before there was a network")
    options = parser.parse_args()
    torch.set_num_threads(1)
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for path in sorted(options.folder.glob("*.wav")):
        events = pressed(path)
        if not len(events):
            print(f"{path.stem} is left out: its curves never press the lips")
            continue
        audio, rate = load_audio(path)
        text = (options.texts / f"{path.stem}.txt").read_text(encoding="utf-8")
        tracks = {
            "the network": find_phones(audio, rate).phones,
            "with the text": find_phones(audio, rate, text=text, language="zh").phones,
        }
        if options.pocketsphinx:
            tracks["pocketsphinx"] = recognise_by_decoder(audio, rate)
        for way, track in tracks.items():
            found.setdefault(way, []).append((events, closures(track)))
    for near_s in (0.06, 0.1):
        phones.NEAR_S = near_s
        for way, takes in found.items():
            print(f"within {1000 * near_s:.0f} ms, {way}: {score(takes)}")


def pressed(path: Path) -> np.ndarray:
    """When the lips are pressed together, seconds."""
    names = path.with_name("channels.txt").read_text().split()
    take = np.load(path.with_suffix(".npz"))
    weight = take["weights"][:, [names.index(name) for name in PRESSED]].max(axis=1)
    return find_peaks(weight, height=LEAST, prominence=0.75 * LEAST, distance=APART)[0] / float(take["fps"])


def score(takes: list[tuple[np.ndarray, np.ndarray]]) -> str:
    wanted, got = (sum(len(take[side]) for take in takes) for side in (0, 1))
    right = sum(met(*take) for take in takes)
    return f"F {2 * right / (wanted + got):.3f}, recall {right / wanted:.2f}, precision {right / got:.2f} of {wanted} closures"


if __name__ == "__main__":
    main()
