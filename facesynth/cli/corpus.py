"""`facesynth corpus`: a performer's recordings, from files to something to learn from."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.corpus_edit import edit
from facesynth.cli.followed_points import Followed, keep_videos_of, points_followed, require_points
from facesynth.cli.mocap import Said, keep_written_of, read_layout, said_of_files
from facesynth.cli.options import as_json, show, spread_over
from facesynth.cli.transcriber import chosen_transcriber
from facesynth.cli.types import FILE, FOLDER
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.corpus import Corpus
    from facesynth.corpus.add.add import AddReport
    from facesynth.corpus.workers import Workers

EMOTIONS = ("neutral", "happy", "angry", "sad")
"""Those of a corpus for which nobody says them."""
FACTS = ("emotion", "intensity", "take", "sentence", "licence", "consent")
"""Options of `add` that are columns of utterances.csv."""
MOST_NAMED = 8
"""So many recordings are named on the screen; import.csv names all."""


@click.group("corpus")
def corpus_group() -> None:
    """Make, fill and check a corpus: a performer's recordings in a folder of plain files."""


corpus_group.add_command(edit)


@corpus_group.command("new")
@click.argument("folder", type=FOLDER)
@click.option("--performer", required=True, help="Who was recorded.")
@click.option("--layout", "layout_file", type=FILE, required=True, help="Names of channels: YAML, JSON, another corpus.yaml.")
@click.option("--fps", type=float, required=True, help="Rate at which the motion is kept; files of another rate are resampled.")
@click.option("--emotions", default=",".join(EMOTIONS), show_default=True, help="The emotions that the corpus tells apart.")
@click.option("--licence", default="", help="Of every recording that states none of its own; carried into every model.")
@click.option("--consent", default="", help="Who agreed to what, in words; carried into every model.")
@click.option("--notes", default="", help="Remarks.")
@click.option("--synthetic", is_flag=True, help="Voice and face were computed; nobody was recorded.")
@as_json
def new(folder: Path, layout_file: Path, emotions: str, as_json: bool, **about: Any) -> None:
    """Make FOLDER an empty corpus."""
    from facesynth.corpus import Corpus

    names = [name.strip() for name in emotions.split(",") if name.strip()]
    corpus = Corpus.create(folder, layout=read_layout(layout_file), emotions=names, **about)
    keep_written_of(folder, layout_file)
    facts = {name: getattr(corpus, name) for name in ("performer", "emotions")}
    facts |= {"path": str(corpus.path), "channels": corpus.layout.channels}
    show(as_json, facts, [f"{folder} is a corpus of {corpus.performer}; add with `facesynth corpus add {folder} FILES…`"])


@corpus_group.command("add")
@click.argument("folder", type=FOLDER)
@click.argument("files", nargs=-1, required=True, type=FILE)
@click.option("--text", help="What is said, for one recording.")
@click.option("--text-file", type=FILE, help="The same, from a file; or for many, CSV with the columns id and text.")
@click.option("--phones", type=FILE, help="TextGrid, or lines of `end label`, for one recording.")
@click.option("--no-phones", is_flag=True, help="Look for none where none are given, for methods that hear the sound alone.")
@click.option("--speaker", help="Whose phones are taken, where TextGrids hold those of several.")
@click.option("--language", help="Of the texts, such as de or pt (ISO 639-1); found out otherwise.")
@click.option("--transcribe", is_flag=True, help="Let Whisper (`fetch whisper`) write down what is said, where nobody says it.")
@click.option("--transcriber", type=FOLDER, help="The same by the model of faster-whisper in this folder.")
@click.option("--emotion", help="Emotion of every recording added; neutral if nothing says otherwise.")
@click.option("--emotions", type=FILE, help="Emotion that moves over time, for one recording: CSV, or lines of `end emotion`.")
@click.option("--intensity", type=click.FloatRange(0, 1), help="Intensity of the emotion; 1 otherwise.")
@click.option("--take", type=click.IntRange(min=1), help="Which take of the sentence it is; the first otherwise.")
@click.option("--sentence", help="One name for the same words in other emotions and takes; the words themselves otherwise.")
@click.option("--id", "utterance_id", help="Name of the utterance, for one recording; the file's name otherwise.")
@click.option("--licence", help="Of these recordings; the corpus' own otherwise.")
@click.option("--consent", help="Who agreed to what; the corpus' own otherwise.")
@click.option("--list", "list_file", type=FILE, help="CSV with columns as in utterances.csv; id is the files' shared name.")
@click.option("--sound", type=FILE, help="One long sound of a recorder that ran on for several videos: each finds its part.")
@click.option("--face", type=click.IntRange(min=1), help="Which face of a video with several: 1 is the leftmost.")
@click.option("--performer", help="Who was recorded, where FOLDER is no corpus yet; its name otherwise.")
@click.option("--replace", "replacing", is_flag=True, help="Also phones corrected by hand, and a name from another folder.")
@points_followed
@said_of_files
@spread_over()
@as_json
def add(
    *,
    folder: Path,
    files: tuple[Path, ...],
    text: str | None,
    text_file: Path | None,
    utterance_id: str | None,
    list_file: Path | None,
    sound: Path | None,
    performer: str | None,
    followed: Followed | None,
    said: Said,
    workers: Workers,
    as_json: bool,
    **given: Any,
) -> None:
    """Add recordings to the corpus in FOLDER.

    FILES are files or folders. A recording is a video, whose face is captured; or a sound (or a video with sound) and a
    motion file (.npz, .csv, .c3d, .mat, BEAT's .json, Live Link Face, OpenFace) of the same name, or one that holds the
    sound itself. Beside them
    may lie NAME.TextGrid (or .lab), NAME.txt (or .align, .wrd: lines of `start end word`), NAME.emotions.csv, and a CSV
    with the columns id and text for all of them. A FOLDER that is no corpus becomes one that fits the recordings.
    Without phones and text, the phones are recognised from the sound; with --no-phones nothing is, until
    `facesynth corpus align` places them. A run that was interrupted can be repeated; added
    again, only what was given otherwise than before is done anew. FOLDER/import.csv says what was used, what not, and why.
    """
    from facesynth.corpus.add.add import add as add_recordings
    from facesynth.corpus.importers.recorder import cut_for
    from facesynth.corpus.record import read_listed

    listed = read_listed(list_file) if list_file else None
    about = {name: value for name in FACTS if (value := given.pop(name)) is not None}
    given["placing"] = not given.pop("no_phones")
    given["transcriber"] = chosen_transcriber(given.pop("transcribe"), given["transcriber"])
    header = _header(folder, performer, about, listed)
    corpus, guessed = _corpus_for(folder, files, header, followed, given["face"], said, workers)
    known, texts = _words({**about, "id": utterance_id}, text, text_file)
    guessed = (*guessed, *_encodings(text_file, list_file))
    with cut_for(sound, files) as cuts:
        report = add_recordings(corpus, (*files, *cuts.sounds), known, listed=listed, texts=texts, workers=workers, **given)
    keep_videos_of(corpus, files, report, utterance_id)
    show(as_json, {**asdict(report), "guessed": guessed}, [*guessed, *cuts.remarks, *_summary(corpus, report)])
    done = report.added or report.changed or report.kept or report.unchanged
    _leave_if_nothing(not done, report.refused, "no recording was added")


@corpus_group.command("convert")
@click.argument("files", nargs=-1, required=True, type=FILE)
@click.option("-o", "--output", "folder", type=FOLDER, required=True, help="Folder for the files made.")
@said_of_files
@as_json
def convert(files: tuple[Path, ...], folder: Path, said: Said, as_json: bool) -> None:
    """Turn recordings of other systems into plain files, for those who want files; `corpus add` reads them itself.

    FILES are files or folders of C3D, Live Link Face CSV, articulography (MVIEW .mat), BEAT2 poses, or CSV, NPZ and MAT of
    any points or curves (named by --layout, or by layout.yaml or channels.txt beside them). Motion, and sound, phones and
    words in or beside the files, are written to the output folder, with a layout.yaml for `corpus new --layout`.
    """
    from facesynth.corpus.importers.convert import convert as convert_files
    from facesynth.corpus.importers.description import LAYOUT

    report = convert_files(files, folder, description=said.description(), fps=said.fps)
    lines = [f"converted {len(report.converted)}, not usable {len(report.refused)}"]
    if report.converted:
        lines.append(f"make their corpus with `facesynth corpus new NAME --layout {folder / LAYOUT} --fps {report.fps:g} …`")
    lines += report.guessed
    show(as_json, asdict(report), [*lines, *_listing("not converted", report.refused), *_remarks(report.remarks)])
    _leave_if_nothing(not report.converted, report.refused, "nothing was converted")


@corpus_group.command("align")
@click.argument("folder", type=FOLDER)
@click.option("--id", "ids", multiple=True, help="Only this utterance; may be given several times.")
@click.option("--force", is_flag=True, help="Also where phones were given or corrected by hand.")
@spread_over()
@as_json
def align(folder: Path, ids: tuple[str, ...], force: bool, workers: Workers, as_json: bool) -> None:
    """Place the phones of utterances with a text anew; what was corrected by hand stays."""
    from facesynth.corpus import Corpus
    from facesynth.corpus.align import align as align_corpus

    report = align_corpus(Corpus.open(folder), ids or None, force, workers)
    lines = [f"aligned {len(report.aligned)}, kept {len(report.kept)}, failed {len(report.failed)}"]
    lines += [*_listing("kept", report.kept), *_listing("failed", report.failed), *_remarks(report.warnings)]
    show(as_json, asdict(report), lines)
    _leave_if_nothing(not report.aligned, report.failed, "no utterance was aligned")


@corpus_group.command("check")
@click.argument("folder", type=FOLDER)
@as_json
def check(folder: Path, as_json: bool) -> None:
    """Say everything that is wrong with a corpus; exit code 2 where something grave is."""
    from facesynth.corpus.checks.check import check as check_corpus
    from facesynth.methods.registry import needs

    problems = check_corpus(folder, needs())
    grave = sum(problem.grave for problem in problems)
    summary = f"{grave} problems, {len(problems) - grave} notes" if problems else "nothing is wrong"
    show(as_json, {"problems": [asdict(problem) for problem in problems]}, [*map(str, problems), summary])
    if grave:
        sys.exit(2)


@corpus_group.command("stats")
@click.argument("folder", type=FOLDER)
@click.option("--sentences", type=FILE, help="Sentences to choose from, one a line; those of the built-in performer otherwise.")
@click.option("--add", "count", type=click.IntRange(min=0), default=5, show_default=True, help="How many sentences to name.")
@click.option("--pictures", type=FOLDER, help="Draw each recording into this folder: waveform, phones, opening of the mouth.")
@as_json
def stats(folder: Path, sentences: Path | None, count: int, pictures: Path | None, as_json: bool) -> None:
    """Count what a corpus holds: minutes, emotions, takes, phones, diphones, gaps; name sentences that would add most."""
    from facesynth.corpus import Corpus
    from facesynth.corpus.coverage import read_sentences, sentences_to_add
    from facesynth.corpus.stats import stats as count_all
    from facesynth.performer.script import load_script

    corpus = Corpus.open(folder)
    counted = count_all(corpus)
    candidates = read_sentences(sentences) if sentences else tuple(line.text for line in load_script("full"))
    wanted = sentences_to_add(corpus, candidates, count) if count else ()
    drawn: tuple[Path, ...] = ()
    if pictures is not None:
        from facesynth.corpus.pictures import draw_all

        drawn = draw_all(corpus, pictures)
    lines = [counted.text(), *(f"would add most    {found.text} ({found.new} new diphones)" for found in wanted)]
    facts = {
        **counted.to_dict(),
        "would_add_most": [asdict(found) for found in wanted],
        "pictures": [str(path) for path in drawn],
    }
    show(as_json, facts, [*lines, *([f"{len(drawn)} pictures are in {pictures}"] if drawn else [])])


def _corpus_for(
    folder: Path,
    files: tuple[Path, ...],
    header: Mapping[str, Any],
    followed: Followed | None,
    face: int | None,
    said: Said,
    workers: Workers,
) -> tuple[Corpus, tuple[str, ...]]:
    """The corpus in a folder, or a new one for the performer of recordings, and what was guessed of them."""
    from facesynth.corpus import Corpus
    from facesynth.corpus.importers.video import corpus_from_video

    if (folder / "corpus.yaml").exists():
        corpus = Corpus.open(folder)
        require_points(corpus, followed is not None)
        said.require_nothing()
        return corpus, ()
    if followed is not None:
        return followed.corpus(folder, files, header, face), ()
    if (made := said.corpus(folder, files, header, workers)) is not None:
        return made
    return corpus_from_video(folder, files, header, face=face, workers=workers), ()


def _header(
    folder: Path, performer: str | None, about: Mapping[str, Any], listed: Mapping[str, Mapping[str, Any]] | None
) -> dict[str, Any]:
    """What is said of a new corpus; its emotions are the usual ones and those of its recordings."""
    said = [facts["emotion"] for facts in (about, *(listed or {}).values()) if "emotion" in facts]
    return {
        "performer": performer or folder.resolve().name,
        "emotions": list(dict.fromkeys([*EMOTIONS, *said])),
        "licence": about.get("licence", ""),
        "consent": about.get("consent", ""),
    }


def _words(about: Mapping[str, Any], text: str | None, text_file: Path | None) -> tuple[dict[str, Any], dict[str, str] | None]:
    """What is known of every recording, with the text of the one that is added; and a table of the texts of many."""
    from facesynth.corpus.add.transcripts import read_transcripts
    from facesynth.stage.listening import read_text

    is_table = text_file is not None and text_file.suffix.lower() == ".csv"
    said = text or (" ".join(read_text(text_file).split()) if text_file and not is_table else None)
    known = {name: value for name, value in {**about, "text": said}.items() if value is not None}
    return known, read_transcripts(text_file) if text_file and is_table else None


def _summary(corpus: Corpus, report: AddReport) -> list[str]:
    """What a person reads after an import."""
    from facesynth.corpus.add.account import account_path, phones_from

    counts = {
        "added": len(report.added),
        "changed": len(report.changed),
        "already there": len(report.unchanged),
        "not usable": len(report.refused),
    }
    lines = [", ".join(f"{what} {count}" for what, count in counts.items() if count or what != "changed")]
    if report.added:
        minutes = sum(corpus.duration_s(name) for name in report.added) / 60
        phones = Counter(phones_from(corpus, corpus.record(name)) for name in report.added)
        lines.append(f"added: {_some(report.added)}: {minutes:.1f} minutes, phones {_counted(phones)}")
    lines += _listing("changed", {name: ", ".join(parts) for name, parts in report.changed.items()})
    lines += [*_listing("kept", report.kept), *_listing("not added", report.refused), *_remarks(report.remarks)]
    return [*lines, f"{account_path(corpus)} says so of each recording"]


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def _counted(counts: Mapping[str, int]) -> str:
    return ", ".join(what if len(counts) == 1 else f"{what} in {count}" for what, count in sorted(counts.items()))


def _encodings(*given: Path | None) -> tuple[str, ...]:
    """What is said of the files with words whose encoding had to be guessed."""
    from facesynth.encoding import encoding_remark

    return tuple(remark for path in given if path is not None for remark in encoding_remark(path))


def _listing(what: str, reasons: Mapping[str, str]) -> list[str]:
    return [f"{what}: {line}" for line in _remarks({name: [reason] for name, reason in reasons.items()})]


def _remarks(remarks: Mapping[str, Iterable[str]]) -> list[str]:
    """A line for each remark; one that is the same of several recordings is said once, with their number."""
    names: dict[str, list[str]] = {}
    for name, said in remarks.items():
        for remark in said:
            names.setdefault(remark, []).append(name)
    return [
        f"{alike[0]}: {remark}" if len(alike) == 1 else f"{len(alike)} recordings ({_some(alike)}): {remark}"
        for remark, alike in names.items()
    ]


def _leave_if_nothing(nothing: bool, reasons: Mapping[str, str], what: str) -> None:
    """One clear error where a command could do nothing at all."""
    if nothing and reasons:
        name, reason = next(iter(reasons.items()))
        raise FacesynthError(f"{what}; {name}: {reason}")
