"""Several simulations at once, each in a process of its own, drawn together.

Ctrl-C reaches every process of a terminal: each simulation ends in order, and this waits for them.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from volery.cli.console import Output
from volery.cli.progress import Pictures, Seldom, drawn
from volery.requirements.record import RunRecord
from volery.run.progress import Progress
from volery.run.result import Options
from volery.run.simulate import simulate

LOOK_S = 0.1
"""Wall seconds between two looks at what the processes have sent."""


@dataclass(frozen=True)
class Job:
    """A simulation to be run in fidelity ``code``."""

    model: Path
    allocation: str
    seed: int
    out: Path


@dataclass(frozen=True)
class Outcome:
    """What came of it; unlike a ``Run`` it can be sent from process to process."""

    record: RunRecord
    folder: Path
    complaints: tuple[str, ...]

    @property
    def completed(self) -> bool:
        """True if it came to its own end and all of it was written."""
        return self.record.outcome.status == "completed" and not self.complaints


def run_all(output: Output, jobs: Mapping[str, Job]) -> dict[str, Outcome]:
    """Run them; by the names of *jobs*. Raises what the first job that could not start raised."""
    context = multiprocessing.get_context("spawn")
    news = context.SimpleQueue()
    with (
        drawn(output) as pictures,
        _left_to_the_processes(),
        ProcessPoolExecutor(len(jobs), context, _Sender.open, (news if pictures else None,)) as pool,
    ):
        futures = {name: pool.submit(_run, name, job) for name, job in jobs.items()}
        _watch(list(futures.values()), news, pictures)
    return {name: future.result() for name, future in futures.items()}


def _watch(futures: list[Future[Outcome]], news: Any, pictures: Pictures | None) -> None:
    while wait(futures, timeout=LOOK_S).not_done:
        while pictures is not None and not news.empty():
            pictures.show(*news.get())


@contextmanager
def _left_to_the_processes() -> Iterator[None]:
    """The signal that ends a run is for those that run it; a terminal sends it there as well."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


class _Sender:
    """How a process sends its progress: set once when it starts, since queues cannot be sent later."""

    news: Any = None

    @classmethod
    def open(cls, news: Any) -> None:
        """Called first in each process."""
        cls.news = news

    @classmethod
    def sending(cls, name: str) -> Callable[[Progress], None] | None:
        """What a run is to call; ``None`` where nobody watches."""
        news = cls.news
        return None if news is None else Seldom(lambda progress: news.put((name, progress)))


def _run(name: str, job: Job) -> Outcome:
    """In a process of its own."""
    options = Options("code", job.seed, None, job.out, _Sender.sending(name))
    run = simulate(job.model, options, allocation=job.allocation)
    complaints = [] if run.completed else [f"{run.record.outcome.status}: {run.record.outcome.reason}"]
    return Outcome(run.record, job.out, (*complaints, *run.problems))
