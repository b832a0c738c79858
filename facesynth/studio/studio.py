"""What all windows of one studio share: the project, the corpus, the model, and what runs."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Protocol, TypeVar

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.methods.capabilities import Explaining
from facesynth.methods.registry import known_capabilities, load, method_class
from facesynth.speech.hearing import hear
from facesynth.stage.performance import OUTPUTS
from facesynth.stage.request import Request
from facesynth.studio.document import first_take, take_facts
from facesynth.studio.jobs import Job, Jobs
from facesynth.studio.library import Signature, corpus_facts, differing, recorded, set_text, signature
from facesynth.studio.messages import project_facts
from facesynth.studio.node_maps import NodeMaps
from facesynth.studio.performing import Performing, Shown, model_facts
from facesynth.studio.project import NODES, Kept, Project
from facesynth.studio.speak_files import WHY, arguments, request_of

REPORTS = "reports"
LOOK_EVERY_S = 2.0
"""Between looks at the disk."""
Result = TypeVar("Result")


class Window(Protocol):
    """A browser window that is told what changes."""

    async def tell(self, message: dict[str, Any]) -> None:
        """Send it a message."""
        ...

    def refresh(self, kept: Kept) -> None:
        """What it shows may have changed."""
        ...


class Studio:
    """One project, one corpus, one model (if there is one), any number of windows."""

    def __init__(self, project: Project, corpus: Path, model: Path | None, performing: Performing | None) -> None:
        self.project, self.corpus, self.model, self.performing = project, Corpus.open(corpus), model, performing
        self.windows: set[Window] = set()
        self.jobs = Jobs(self._tell_job)
        self._maps: tuple[tuple[Performing, int], NodeMaps] | None = None
        self._thread = ThreadPoolExecutor(1, "studio")
        self._seen: Signature = signature(self.corpus.path, model)

    async def away(self, work: Callable[..., Result], *arguments: Any) -> Result:
        """What takes long, off the thread that answers."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, work, *arguments)

    async def tell_all(self, message: dict[str, Any]) -> None:
        """Every window."""
        await asyncio.gather(*(window.tell(message) for window in list(self.windows)))

    async def change(self, do: str, arguments: dict[str, Any], base: int | None) -> Kept:
        """Make and keep a change; every window is told."""
        kept = self.project.change(do, arguments, base)
        await self.tell_all({"kind": "project", **project_facts(self.project, kept.lines)})
        for window in list(self.windows):
            window.refresh(kept)
        return kept

    def facts(self) -> dict[str, Any]:
        """Everything a new window must know."""
        model = model_facts(self.performing.model, self.model) if self.performing and self.model else None
        facts: dict[str, Any] = {
            "kind": "all",
            "project": project_facts(self.project),
            "corpus": corpus_facts(self.corpus),
            "model": model,
        }
        facts |= {
            "corpus": corpus_facts(self.corpus),
            "outputs": self._outputs(),
            "methods": mouths(),
            "markers": self.performing.markers() if self.performing else [],
            "jobs": [job.facts() for job in self.jobs.known],
        }
        return {**facts, "folder": str(self.project.folder), "reports": self.reports()}

    def require_performing(self) -> Performing:
        """The model's; FacesynthError without one."""
        if self.performing is None:
            raise FacesynthError("there is no model yet: train one on the page of the corpus, or start the studio with one")
        return self.performing

    def require_maps(self) -> NodeMaps:
        """The maps of the model's nodes; FacesynthError where it has none."""
        performing = self.require_performing()
        known = performing, self.project.changed_at.get(NODES, 0)
        if self._maps is None or self._maps[0] != known:
            self._maps = known, NodeMaps(performing.model, self.project.edits)
        return self._maps[1]

    async def show(self, line: str, take: str) -> Shown:
        """The whole face of a take as it is."""
        found = self.project.document.line(line)
        work = self.require_performing().whole
        return await self.away(work, self.project.sound(line), self.project.edits, found, found.take(take))

    async def next_best(self, line: str, take: str, phone: int) -> list[dict[str, Any]]:
        """Nodes that could stand at a phone, and what the whole would cost more."""
        found = self.project.document.line(line)
        work = self.require_performing().explanation
        rows = await self.away(work, self.project.sound(line), self.project.edits, found, found.take(take))
        if not 0 <= phone < len(rows):
            raise FacesynthError(f"there is no phone {phone}; the take has 0 to {len(rows) - 1}")
        return list(rows[phone].get("runners_up", []))

    async def show_recording(self, utterance: str) -> Shown:
        """The motion that was recorded with an utterance, on the head."""
        performing = self.require_performing()

        def shown() -> Shown:
            found, _ = recorded(self.corpus, utterance)
            return performing.of_motion(found.motion, found.speech)

        return await self.away(shown)

    async def add_utterance(self, utterance: str, base: int | None) -> str:
        """A line of what an utterance says; gives its name."""
        found, words = await self.away(recorded, self.corpus, utterance)
        await self._add_line(utterance, found.speech, words, utterance, base)
        return utterance

    async def add_sound(self, name: str, path: Path, text: str | None) -> str:
        """A line of a sound that somebody brought; its phones are found as `speak` finds them."""
        emotions = self.performing.model.emotions if self.performing else self.corpus.emotions
        try:
            heard = await self.away(lambda: hear(path, text=text, emotion=emotions[0]))
        except FacesynthError as error:
            raise FacesynthError(str(error).replace(str(path), path.name)) from None
        await self._add_line(name, heard.speech, heard.words, "", None)
        await self.tell_all({"kind": "note", "lines": list(heard.warnings)})
        return name

    def export(self, line: str, take: str, suffixes: list[str]) -> Job:
        """Let the command line speak the take's files into files of the project."""
        performing, folder = self.require_performing(), self.project.folder
        possible = self._outputs()
        if not set(suffixes) & set(OUTPUTS) or not set(suffixes) <= set(possible):
            also = f" ({WHY} beside another)" if WHY in possible else ""
            raise FacesynthError(f"what can be exported is {', '.join(possible)}{also}; got {', '.join(suffixes) or 'nothing'}")
        said = self.project.document.line(line).take(take)
        request = request_of(
            said, self.project.take_folder(line, take), self.project.edits, performing.model.capabilities, performing.request
        )
        outputs = [folder / "exports" / f"{line}-{take}{suffix}" for suffix in suffixes]
        words = arguments(self._model_path(), self.project.sound(line), request, said, outputs)
        return self.jobs.start(f"export {line}, take {take}", words)

    async def keep_edits(self) -> int:
        """Let the corpus take over removed and drawn nodes; gives how many edits are new there."""
        count = self.project.keep_edits(self.corpus.path)
        self._seen = signature(self.corpus.path, self.model)
        return count

    async def set_text(self, utterance: str, text: str) -> None:
        """Correct a transcript, which is no news from the disk: every window shows it, and none says that something changed."""
        set_text(self.corpus, utterance, text)
        self._seen = signature(self.corpus.path, self.model)
        await self.reload([])

    def train(self, method: str) -> Job:
        """Let the command line learn a model of the corpus, and use it when it is there."""
        path = self.project.folder / "models" / f"{method_class(method).name}.safetensors"
        path.parent.mkdir(exist_ok=True)

        async def use(_job: Job) -> None:
            await self.use_model(path)

        return self.jobs.start(f"train {method}", ["train", method, str(self.corpus.path), "-o", str(path)], use)

    def evaluate(self, method: str, folds: int, references: bool) -> Job:
        """Let the command line write a report: a method, beside the reference rows or alone, on sentences that it did not see."""
        name = method_class(method).name
        folder = self.project.folder / REPORTS / f"{name}-{len(self.reports()) + 1}"

        async def tell(_job: Job) -> None:
            await self.tell_all({"kind": "reports", "reports": self.reports()})

        asked = ["--folds", str(folds), *([] if references else ["--no-references"])]
        return self.jobs.start(f"evaluate {name}", ["evaluate", str(self.corpus.path), name, "-o", str(folder), *asked], tell)

    def reports(self) -> list[str]:
        """Names of the project's reports, the oldest first."""
        pages = (self.project.folder / REPORTS).glob("*/index.html")
        return [page.parent.name for page in sorted(pages, key=lambda page: page.stat().st_mtime)]

    async def use_model(self, path: Path) -> None:
        """Speak with another model from now on; every window begins anew with it."""
        shown = self.performing.request if self.performing else Request()
        self.performing = await self.away(lambda: Performing(load(path), shown))
        self.model = path
        self._seen = signature(self.corpus.path, path)
        self.project.keep_facts(model=path)
        await self.tell_all(self.facts())

    def _outputs(self) -> tuple[str, ...]:
        """Suffixes of what can be exported."""
        told = self.performing is not None and Explaining in self.performing.model.capabilities.abilities
        return (*OUTPUTS, WHY) if told else OUTPUTS

    def _model_path(self) -> Path:
        if self.model is None:
            raise FacesynthError("there is no model yet")
        return self.model

    async def watch(self) -> None:
        """Tell, as long as the studio is open, when corpus or model changed on the disk."""
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            now = signature(self.corpus.path, self.model)
            if names := differing(self._seen, now):
                self._seen = now
                await self.reload(names)

    async def reload(self, names: list[str]) -> None:
        """Read the corpus anew and say why; nothing is said where no name is given."""
        try:
            self.corpus = Corpus.open(self.corpus.path)
            await self.tell_all({"kind": "corpus", "changed": names, "corpus": corpus_facts(self.corpus)})
        except FacesynthError as error:
            await self.tell_all({"kind": "note", "lines": [f"the corpus changed on disk and cannot be read: {error}"]})

    async def close(self) -> None:
        """End what runs; everything was kept before."""
        await self.jobs.close()
        self._thread.shutdown(cancel_futures=True)
        self.project.close()

    async def _add_line(self, name: str, speech: Speech, words: Any, utterance: str, base: int | None) -> None:
        emotions = self.require_performing().model.emotions if self.performing else self.corpus.emotions
        track = speech.emotions
        if not set(track.labels) <= set(emotions):
            track = EmotionTrack.constant(emotions[0], speech.duration_s)
        self.project.keep_sound(name, speech.audio, speech.sample_rate)
        take = take_facts(first_take(speech.phones, words, track))
        await self.change("add_line", {"name": name, "text": speech.text, "take": take, "utterance": utterance}, base)

    async def _tell_job(self, job: Job) -> None:
        await self.tell_all({"kind": "job", "job": job.facts()})


def mouths() -> list[str]:
    """Methods that can be trained to move a mouth, those that need least first."""
    return [one.name for one in known_capabilities()[0] if one.part == "mouth"]
