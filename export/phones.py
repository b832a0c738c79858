"""Write the network that hears phones as a folder that runs without torch: `python export/phones.py phones -o FOLDER`."""

from facesynth.cli.export import export_only

if __name__ == "__main__":
    export_only("phones")
