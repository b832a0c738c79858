"""Verbs of the command line that run beside the page: exporting, checking, aligning, training; told as they go on."""

import asyncio
import os
import shlex
import sys
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from facesynth.inference.errors import FacesynthError
from facesynth.progress import LINE_EVERY_VARIABLE

LINES_KEPT = 200
Told = Callable[["Job"], Awaitable[None]]


@dataclass
class Job:
    """One verb that runs, or ran."""

    number: int
    title: str
    arguments: tuple[str, ...]
    """After `facesynth`."""
    lines: list[str] = field(default_factory=list)
    """What it said, the newest last."""
    output: str = ""
    """What it printed."""
    code: int | None = None
    """How it ended; None while it runs."""
    done: Told | None = None
    """Called when it ended well."""
    process: asyncio.subprocess.Process | None = None

    def facts(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {
            "number": self.number,
            "title": self.title,
            "command": shlex.join(["facesynth", *self.arguments]),
            "lines": self.lines[-8:],
            "output": self.output,
            "code": self.code,
        }


class Jobs:
    """One after the other, so that they do not slow each other down."""

    def __init__(self, tell: Told) -> None:
        self.known: list[Job] = []
        self._tell = tell
        self._turn = asyncio.Lock()
        self._tasks: set[asyncio.Task[None]] = set()

    def start(self, title: str, arguments: Sequence[str], done: Told | None = None) -> Job:
        """Run `facesynth ARGUMENTS` when those before are done."""
        job = Job(len(self.known) + 1, title, tuple(arguments), done=done)
        self.known.append(job)
        task = asyncio.create_task(self._run(job))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return job

    def cancel(self, number: int) -> None:
        """End one early; FacesynthError where there is none of the number that runs."""
        job = next((job for job in self.known if job.number == number and job.code is None), None)
        if job is None:
            raise FacesynthError(f"nothing with the number {number} is running")
        if job.process is None:
            job.code = -1
        else:
            job.process.terminate()

    async def close(self) -> None:
        """End what runs."""
        for job in self.known:
            if job.process is not None and job.code is None:
                job.process.terminate()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _run(self, job: Job) -> None:
        async with self._turn:
            if job.code is not None:
                await self._tell(job)
                return
            job.process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "facesynth", *job.arguments),
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
                env={**os.environ, LINE_EVERY_VARIABLE: "1", "PYTHONUNBUFFERED": "1"},
            )
            await self._tell(job)
            _, printed = await asyncio.gather(self._listen(job, job.process), _all_of(job.process.stdout))
            job.output = printed
            code = await job.process.wait()
        job.code = code
        if code == 0 and job.done is not None:
            await job.done(job)
        await self._tell(job)

    async def _listen(self, job: Job, process: asyncio.subprocess.Process) -> None:
        assert process.stderr is not None  # noqa: S101  # it was asked for
        async for line in process.stderr:
            job.lines = [*job.lines[-LINES_KEPT:], line.decode(errors="replace").rstrip()]
            await self._tell(job)


async def _all_of(stream: asyncio.StreamReader | None) -> str:
    return (await stream.read()).decode(errors="replace") if stream else ""
