import shutil
from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus, tiny_layout, tiny_utterances

from facesynth.corpus import Corpus
from facesynth.corpus.checks.check import check as check_all
from facesynth.corpus.record import write_records
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.methods.registry import needs
from facesynth.speech.audio import save_wav

ID = "s00_happy_t1"


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("shared") / "tiny")


@pytest.fixture
def corpus(shared, tmp_path):
    return Corpus.open(shutil.copytree(shared.path, tmp_path / "tiny"))


def check(corpus):
    """What is wrong, without what a dozen utterances are too few for."""
    found = check_all(corpus, needs())
    return [problem for problem in found if "too few" not in problem.what and "little for" not in problem.what]


def found(corpus, file: str = "") -> str:
    return "\n".join(str(problem) for problem in check(corpus) if file in problem.file)


def store_motion(corpus, change, **beside) -> None:
    motion = corpus.raw_motion(ID)
    points = motion.points.copy()
    points = change(points)
    np.savez(corpus.files.motion(ID), frames=points.reshape(len(points), -1), fps=motion.fps, **beside)


def test_nothing_is_wrong_with_a_good_corpus(shared):
    assert check(shared) == check(shared.path) == []


def test_everything_is_found_in_one_run(corpus):
    corpus.files.audio(ID).unlink()
    corpus.files.phones("s00_neutral_t1").write_text("no grid", encoding="utf-8")
    corpus.files.motion("s01_angry_t1").write_bytes(b"PK")
    corpus.update(replace(corpus.record("s01_sad_t1"), split="train"))
    (corpus.path / "audio" / "stray.wav").write_bytes(b"")
    text = found(corpus)
    for part in (f"audio/{ID}.wav", "phones/s00_neutral_t1.TextGrid", "motion/s01_angry_t1.npz", "note: audio/stray.wav"):
        assert part in text
    assert len(text.splitlines()) == 4


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("id,take\na,1\nb,x\nc,y\n", ("line 3: invalid literal", "line 4: invalid literal")),
        ("id,colour\na,red\n", ("unknown column 'colour'",)),
        ("id,emotion\ns00_happy_t1,hapy\n", ("emotion 'hapy' is none of the corpus'",)),
        ("id\n", ("there is no usable utterance",)),
    ],
)
def test_faults_of_the_table(corpus, table, message):
    corpus.files.records.write_text(table, encoding="utf-8")
    text = found(corpus, "utterances.csv")
    for part in message:
        assert part in text


def test_a_header_that_cannot_be_read(corpus):
    corpus.files.header.write_text("format: 7", encoding="utf-8")
    (problem,) = check(corpus)
    assert "format 7" in problem.what
    assert problem.grave


def test_a_folder_that_is_no_corpus(tmp_path):
    with pytest.raises(FacesynthError, match="is no corpus"):
        check(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: np.where(np.arange(14)[None, :, None] == 13, np.nan, p), "never seen: chin"),
        (lambda p: np.where(np.arange(len(p))[:, None, None] % 3 == 0, np.nan, p), "% of the samples are missing"),
        (lambda p: np.where(np.arange(14)[None, :, None] == 13, p[:1], p), "frozen throughout: chin"),
        (lambda p: p[np.where(np.arange(len(p)) < 130, 0, np.arange(len(p)))], "the whole face is frozen for 1.0"),
        (lambda p: p / 1000, "in metres?"),
        (lambda p: p / 10, "in centimetres?"),
        (lambda p: p * np.nan, "every sample is missing"),
        (lambda p: np.where(p > 80, np.inf, p), "infinite"),
        (lambda p: p[::2], "was it recorded at 60 fps?"),
        (lambda p: p[: len(p) // 3], "the motion lasts"),
    ],
)
def test_faults_of_motion(corpus, change, message):
    store_motion(corpus, change)
    assert message in found(corpus, f"motion/{ID}.npz")


def test_motion_of_another_rate_is_found(corpus):
    np.savez(corpus.files.motion(ID), frames=corpus.raw_motion(ID).frames, fps=100.0)
    assert "runs at 100 fps, the corpus at 120" in found(corpus)


def test_swapped_markers_are_found_with_their_node(corpus):
    def swap(points):
        points[60:80, [7, 8]] = points[60:80, [8, 7]]
        return points

    store_motion(corpus, swap)
    swapped = [problem for problem in check(corpus) if "swapped" in problem.what]
    assert [problem.what.split(" (")[0] for problem in swapped] == ["cheek_r and cheek_l are swapped from 0.50 to 0.67 s"]
    problems = [problem for problem in check(corpus) if "jumps" in problem.what]
    phones = corpus[ID].speech.phones
    nodes = [f"{ID}:{int(np.searchsorted(phones.ends_s, frame / 120, side='right'))}" for frame in (60, 80)]
    assert len(problems) == 2
    for problem, node in zip(problems, nodes, strict=True):
        assert not problem.grave
        assert f"(node {node}," in problem.what
        assert "cheek" in problem.what


def test_a_weight_that_stays_zero_is_no_fault(tmp_path):
    record, speech, motion = tiny_utterances(2)[0]
    layout = type(tiny_layout())("curves", ("jawOpen", "tongueOut"))
    corpus = Corpus.create(tmp_path / "c", performer="A", layout=layout, fps=120, emotions=("neutral",), licence="x", consent="y")
    wave = np.column_stack([np.linspace(0, 1, len(motion)), np.zeros(len(motion))]).astype(np.float32)
    corpus.add_utterance(record, speech, Motion(wave, 120, layout))
    assert [problem.what for problem in check(corpus)] == ["there is only one utterance; nothing is left to test on"]


def test_phones_and_sound_that_do_not_end_together(corpus):
    save_wav(corpus.files.audio(ID), np.random.default_rng(0).normal(0, 0.1, 8000).astype(np.float32), 16000)
    text = found(corpus)
    assert "the sound at 0.50 s" in text
    assert "the motion lasts" in text


def test_silence_is_found(corpus):
    save_wav(corpus.files.audio(ID), np.zeros(24000, np.float32), 16000)
    assert "silent" in found(corpus, "audio")


def test_duplicates_are_found(corpus):
    for path_of in (corpus.files.audio, corpus.files.motion):
        shutil.copy(path_of(ID), path_of("s00_neutral_t1"))
    text = found(corpus, "utterances.csv")
    assert f"{ID}, s00_neutral_t1 have the same sound" in text
    assert f"{ID}, s00_neutral_t1 have the same motion" in text


def test_sentences_that_would_leak_are_found(corpus):
    records = [replace(record, sentence=record.id) if record.sentence == "s00" else record for record in corpus.records]
    records = [
        replace(record, split="test" if record.take == 1 else "train") if record.sentence == "s03" else record
        for record in records
    ]
    write_records(corpus.files.records, records)
    text = found(corpus, "utterances.csv")
    assert "is called 's00_happy_t1' and 's00_neutral_t1'" in text
    assert "sentence 's03' is in training and in test" in text


def test_missing_licences_are_a_note(corpus):
    header = corpus.files.header
    header.write_text(header.read_text(encoding="utf-8").replace("CC0-1.0", "''"), encoding="utf-8")
    (problem,) = check(corpus)
    assert not problem.grave
    assert "12 utterances state no licence" in problem.what


def test_edits_that_fit_nothing_are_found(corpus):
    lines = [
        '{"op": "remove", "node": "nobody:1"}',
        f'{{"op": "remove", "node": "{ID}:99"}}',
        f'{{"op": "remove", "node": "{ID}:2"}}',
    ]
    lines += ['{"op": "add", "phone": "xx", "emotion": "sad", "frames": [[1, 2]]}']
    corpus.files.journal.write_text("\n".join(lines), encoding="utf-8")
    text = found(corpus, "edits.jsonl")
    assert len(text.splitlines()) == 3
    assert "nobody:1" in text
    assert f"{ID}:99" in text
    assert "+:4 (xx, sad, frames [1, 2])" in text
    corpus.files.journal.write_text("nonsense\n", encoding="utf-8")
    assert "line 1: not JSON" in found(corpus, "edits.jsonl")


def test_what_is_unusable_may_be_wrong(corpus):
    corpus.files.motion(ID).unlink()
    corpus.update(replace(corpus.record(ID), usable=False, reason="lost"))
    assert check(corpus) == []


def test_markers_that_are_swapped_throughout_are_grave(corpus):
    store_motion(corpus, lambda points: points[:, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 11, 13]])
    text = found(corpus, f"motion/{ID}.npz")
    assert "corner_r and corner_l are swapped throughout" in text
    assert "give them each other's names" in text


def later(audio, rate, shift_s):
    return np.roll(audio, round(shift_s * rate))


def shifted(corpus, ids, shift_s):
    for utterance_id in ids:
        speech = corpus[utterance_id].speech
        save_wav(corpus.files.audio(utterance_id), later(speech.audio, speech.sample_rate, shift_s), speech.sample_rate)


def test_sound_that_is_shifted_in_all_recordings_is_found(corpus):
    shifted(corpus, corpus.ids, 0.2)
    (problem,) = [problem for problem in check(corpus) if problem.file == "audio"]
    assert problem.grave
    told = int(problem.what.split(" moves ")[1].split(" ms")[0])
    assert "before the sound" in problem.what
    assert abs(told - 200) <= 60
    assert "cut the beginning of every sound" in problem.do


def test_sound_that_is_shifted_in_one_recording_is_found(tmp_path):
    corpus = tiny_corpus(tmp_path / "c", utterances=24)
    shifted(corpus, [corpus.ids[5]], -0.16)
    (problem,) = [problem for problem in check(corpus) if problem.file.startswith("audio")]
    assert problem.file == f"audio/{corpus.ids[5]}.wav"
    assert "the mouth moves 1" in problem.what
    assert "after the sound" in problem.what


@pytest.mark.parametrize("count", [1, 2, 7])
def test_sound_that_is_shifted_is_found_in_few_recordings_too(tmp_path, count):
    corpus = tiny_corpus(tmp_path / "c", utterances=count)
    (note,) = [problem for problem in check_all(corpus) if problem.file == "audio"]
    assert not note.grave
    assert f"{count} recording{'s are' if count > 1 else ' is'} too few to find" in note.what
    shifted(corpus, corpus.ids, 0.4)
    found = [problem for problem in check_all(corpus) if problem.file == "audio"]
    assert [problem.grave for problem in found] == [True, False]
    assert abs(int(found[0].what.split(" moves ")[1].split(" ms")[0]) - 400) <= 60
    assert "before the sound" in found[0].what
    assert "too few" in found[1].what


def test_a_copy_that_is_not_the_same_to_the_byte_is_found(corpus):
    text = corpus.files.header.read_text(encoding="utf-8")
    corpus.files.header.write_text(text.replace("synthetic: true", "synthetic: false"), encoding="utf-8")
    speech = corpus[ID].speech
    save_wav(corpus.files.audio("s00_neutral_t1"), 0.5 * speech.audio[40:], speech.sample_rate)
    assert f"{ID} and s00_neutral_t1 have nearly the same sound" in found(corpus, "utterances.csv")


def test_too_little_is_told_by_method_with_what_to_do(shared):
    told = [problem for problem in check_all(shared, needs()) if problem not in check(shared)]
    text = "\n".join(map(str, told))
    assert not any(problem.grave for problem in told)
    short = ", ".join(f"{need.method} ({need.minutes:g})" for need in needs())
    assert f"minutes are little for {short}" in text
    assert "ridge (1)" in short
    assert short.endswith("efase (5)")
    assert "happy: too few for efase" in text
    assert "corpus stats" in text
    assert "too few recordings to tell an emotion by its sound" in text
