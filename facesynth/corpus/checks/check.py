"""Everything that is wrong with a corpus, in one run."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from facesynth.corpus.checks import needs, sync, whole
from facesynth.corpus.checks.motion import motion_problems
from facesynth.corpus.checks.problem import Problem, attempt
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.files import Files
from facesynth.corpus.header import Header, no_corpus, read_header
from facesynth.corpus.limits import LARGEST_DIFFERENCE_S
from facesynth.corpus.record import Record, parse_records
from facesynth.corpus.signals import read_emotion_track, read_motion
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.irregular import USUAL_FPS
from facesynth.progress import track
from facesynth.speech.audio import read_sound, require_sound
from facesynth.speech.textgrid import read_labelled


def check(corpus: Corpus | str | Path, methods: Sequence[needs.Need] = ()) -> list[Problem]:
    """Everything that is wrong with a corpus, grave things first, each with what to do about it.

    A path is enough, for a corpus may be too damaged to open; a folder without corpus.yaml is a FacesynthError. What is
    marked unusable may be wrong. methods: what the methods need that are to learn from it.
    """
    files = Files(corpus.path if isinstance(corpus, Corpus) else Path(corpus))
    if not files.header.is_file():
        raise no_corpus(files.root)
    try:
        header = read_header(files.header)
        records, faults = parse_records(files.records)
    except FacesynthError as error:
        return [Problem("corpus.yaml", str(error), "mend the file, or restore it from a copy")]
    problems = [Problem("utterances.csv", fault.removeprefix(", ").strip(), "mend the line") for fault in faults]
    phones: dict[str, int] = {}
    for record in track(records.values(), "checking"):
        found, count = _utterance_problems(files, header, record)
        problems += found
        phones |= {record.id: count} if count else {}
    problems += whole.duplicates(files, records.values())
    if not header.synthetic:  # computed voices repeat themselves
        problems += whole.nearly_duplicates(files, records.values())
    problems += sync.sync_problems(files, header, records.values())
    problems += needs.lacking(files, records.values(), methods)
    problems += whole.sentences(records.values())
    problems += whole.strays(files, records)
    problems += whole.rights(header, records.values())
    problems += whole.edits(files, header, records, phones)
    return sorted(problems, key=lambda problem: (not problem.grave, problem.file))


def node_problems(corpus: Corpus) -> list[Problem]:
    """What the check finds in the motion of single nodes, in usable utterances that can be read; `check` names the others."""
    problems: list[Problem] = []
    for record in track(corpus.usable_records, "checking"):
        with suppress(FacesynthError):
            phones = read_labelled(corpus.files.phones(record.id), corpus.duration_s(record.id)).phones
            found = motion_problems(f"motion/{record.id}.npz", record.id, corpus.raw_motion(record.id), phones)
            problems += [problem for problem in found if problem.nodes]
    return problems


def _utterance_problems(files: Files, header: Header, record: Record) -> tuple[list[Problem], int]:
    """What is wrong with one utterance, and how many phones it has (0 where they cannot be read)."""
    name, problems = record.id, list[Problem]()
    if not record.usable:
        return problems, 0
    sound_s = attempt(
        problems, f"audio/{name}.wav", "restore it, or mark the utterance unusable", lambda: _sound_s(problems, files.audio(name))
    )
    grid = f"phones/{name}.TextGrid"
    said = attempt(problems, grid, "mend it in Praat, or align it again", lambda: read_labelled(files.phones(name), sound_s))
    problems += [Problem(grid, remark, "correct it if that is not meant", grave=False) for remark in said.remarks] if said else []
    phones = said.phones if said else None
    motion = attempt(
        problems, f"motion/{name}.npz", "restore it, or add the recording again", lambda: read_motion(files.motion(name), header)
    )
    if motion is not None:
        problems += motion_problems(f"motion/{name}.npz", name, motion, phones if phones and phones.known else None)
    problems += _emotion_problems(files, header, record, phones)
    problems += _length_problems(name, sound_s, phones, motion)
    return problems, 0 if phones is None else len(phones)


def _emotion_problems(files: Files, header: Header, record: Record, phones: PhoneTrack | None) -> list[Problem]:
    """Emotions that the corpus does not know, in the table or in the utterance's own file."""
    problems: list[Problem] = []
    file = f"emotions/{record.id}.csv"
    named = {"utterances.csv": [record.emotion]}
    if phones is not None and files.emotions(record.id).exists():
        emotions = attempt(problems, file, "correct the file", lambda: read_emotion_track(files, record, phones.duration_s))
        named[file] = sorted(set(emotions.labels)) if emotions else []
    for where, labels in named.items():
        for label in labels:
            if label not in header.emotions:
                what = f"{record.id}: emotion {label!r} is none of the corpus' {', '.join(header.emotions)}"
                problems.append(Problem(where, what, "correct the emotion, or add it to corpus.yaml"))
    return problems


def _sound_s(problems: list[Problem], path: Path) -> float:
    sound = read_sound(path)
    do = "write the file again, so that every program reads it so"
    problems += [Problem(f"audio/{path.name}", remark, do, grave=False) for remark in sound.remarks]
    require_sound(sound.audio, sound.sample_rate)
    return len(sound.audio) / sound.sample_rate


def _length_problems(name: str, sound_s: float | None, phones: PhoneTrack | None, motion: Motion | None) -> list[Problem]:
    """Sound, phones and motion that do not end together, with the rate that would explain it."""
    problems = []
    if sound_s is not None and phones is not None and abs(phones.duration_s - sound_s) > LARGEST_DIFFERENCE_S:
        what = f"the phones end at {phones.duration_s:.2f} s, the sound at {sound_s:.2f} s"
        problems.append(Problem(f"phones/{name}.TextGrid", what, "correct the TextGrid, or align it again"))
    length_s = sound_s if sound_s is not None else phones.duration_s if phones is not None else None
    if motion is not None and length_s is not None and abs(motion.duration_s - length_s) > LARGEST_DIFFERENCE_S:
        meant = [rate for rate in USUAL_FPS if abs(len(motion) / rate - length_s) < min(LARGEST_DIFFERENCE_S, 0.005 * length_s)]
        guess = f"; was it recorded at {min(meant, key=lambda r: abs(len(motion) / r - length_s)):.6g} fps?" if meant else ""
        what = f"the motion lasts {motion.duration_s:.2f} s at {motion.fps:g} fps, the sound {length_s:.2f} s{guess}"
        problems.append(Problem(f"motion/{name}.npz", what, "trim both to the same moment, or add it with the right rate"))
    return problems
