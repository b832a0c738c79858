"""`python -m facesynth VERB …`."""

from facesynth.cli import main

if __name__ == "__main__":
    main()
