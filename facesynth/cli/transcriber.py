"""Who writes down what is said, as it is asked for on the command line."""

from pathlib import Path


def chosen_transcriber(transcribe: bool, folder: Path | None) -> Path | None:
    """The folder that was given, else that of the model that was fetched, else nobody; FacesynthError where it is of no use."""
    if folder is None and not transcribe:
        return None
    from facesynth.speech.transcription import fetched_folder, require_transcriber

    chosen = folder or fetched_folder()
    require_transcriber(chosen)
    return chosen
