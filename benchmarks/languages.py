"""How well phones of other languages are heard, and texts in them placed: `python benchmarks/languages.py [--languages de fr …]`.

The sentences are said by espeak-ng (a program beside facesynth, GPL; Debian: `apt install espeak-ng`), which also says which
phones it said. Both are read through the same table of sounds. Printed are phone and viseme errors of pocketsphinx and of the
network without a text; of the text's own phones, as the extra `languages` pronounces it; and whether the text is accepted as
that of the sound, and those of how many of the other languages' sentences are.
"""

import argparse
import io
import shutil
import subprocess
import sys
from itertools import groupby

import numpy as np
import soundfile
import torch
from alignment import edits, spoken

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import viseme_of
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.decoder_recognition import recognise_by_decoder
from facesynth.speech.ipa_words import phones_of_ipa
from facesynth.speech.languages import pronounced
from facesynth.speech.recognition import recognise
from facesynth.speech.text_alignment import belongs, heard_classes, told

SENTENCES = {
    "ar": "يلعب الولد الصغير بالكرة في الحديقة.",
    "cs": "Malý chlapec si hraje s míčem v parku.",
    "de": "Die schöne Füchsin bäckt heute fünf Brötchen mit Pflaumenmus.",
    "el": "Το μικρό αγόρι παίζει μπάλα στο πάρκο.",
    "es": "El perro bebe mucha agua bajo el puente.",
    "fi": "Pieni poika pelaa palloa puistossa.",
    "fr": "Le petit garçon mange une pomme rouge dans le jardin.",
    "hi": "छोटा लड़का पार्क में गेंद से खेलता है।",
    "hu": "A kisfiú labdával játszik a parkban.",
    "it": "La bambina gioca con il pallone nel parco.",
    "ja": "ちいさな おとこのこが こうえんで ぼーるを なげて います。",
    "ko": "작은 소년이 공원에서 공을 가지고 놀아요.",
    "nl": "De kleine jongen speelt met een bal in het park.",
    "pl": "Mała dziewczynka bawi się piłką w parku.",
    "pt": "O menino comprou uma bola bonita para brincar.",
    "ru": "Маленький мальчик играет с мячом в парке.",
    "sv": "Den lilla pojken spelar boll i parken.",
    "tr": "Küçük çocuk parkta topla oynuyor.",
    "vi": "Cậu bé chơi bóng trong công viên.",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--languages", nargs="+", default=list(SENTENCES), choices=list(SENTENCES))
    options = parser.parse_args()
    if shutil.which("espeak-ng") is None:
        sys.exit("espeak-ng, which says the sentences, is not installed")
    torch.set_num_threads(1)
    print("| | phones | pocketsphinx | the network | phones of the text | text accepted | of other texts |")
    print("|---|---:|---:|---:|---:|---|---:|")
    for language in options.languages:
        print(row(language), flush=True)


def row(language: str) -> str:
    audio, rate, truth = said(language)
    cells = [f"{wrong(heard, truth)}" for heard in (recognise_by_decoder(audio, rate), recognise(audio, rate, fit=False))]
    classes = heard_classes(audio, rate)
    verdicts = {}
    for other, text in SENTENCES.items():
        try:
            verdicts[other] = [phones for _, phones in pronounced(text, other)]
        except FacesynthError as error:
            print(error, file=sys.stderr)
    own = [phone for word in verdicts.get(language, []) for phone in word]
    accepted = {
        other: (found := told(classes, words)) is not None and belongs(classes, found) for other, words in verdicts.items()
    }
    texts = (
        f"{share(own, truth)} | {'yes' if accepted.pop(language, False) else 'no'} | {sum(accepted.values())} of {len(accepted)}"
    )
    return f"| {language} | {len(truth)} | {' | '.join(cells)} | {texts} |"


def said(language: str) -> tuple[np.ndarray, int, list[str]]:
    """The sentence's sound and its phones."""
    command = ["espeak-ng", "-v", language, "-s", "150"]
    sound = subprocess.run([*command, "--stdout", SENTENCES[language]], check=True, capture_output=True).stdout
    told_ipa = subprocess.run([*command, "-q", "--ipa", SENTENCES[language]], check=True, capture_output=True, text=True).stdout
    audio, rate = soundfile.read(io.BytesIO(sound), dtype="float32")
    return audio, rate, [phone for word in told_ipa.split() for phone in phones_of_ipa(word)]


def wrong(heard: PhoneTrack, truth: list[str]) -> str:
    return share(spoken(heard), truth)


def share(phones: list[str], truth: list[str]) -> str:
    """Shares of wrong phones and of wrong visemes."""
    per = edits(phones, truth) / len(truth)
    ver = edits(visemes(phones), visemes(truth)) / len(visemes(truth))
    return f"{per:.2f} / {ver:.2f}"


def visemes(phones: list[str]) -> list[int]:
    return [viseme for viseme, _ in groupby(map(viseme_of, phones))]


if __name__ == "__main__":
    main()
