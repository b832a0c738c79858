"""Export what is heard in sound (RASTA-PLP, cepstrum, log-mel, mel cepstra): python export/features.py -o folder/."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("features")
