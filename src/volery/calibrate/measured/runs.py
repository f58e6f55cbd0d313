"""One run of a model's nodes on a real master, and what each of them took."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from volery.base.errors import ComponentError, LinkSilent
from volery.base.time import MS, Ns, S
from volery.calibrate.measured.programs import NodeProgram
from volery.transports.ros1.master import Master
from volery.transports.ros1.roscore import environment

READY: Ns = 30 * S
SETTLE: Ns = S
GLANCE: Ns = 20 * MS
GOOD_BYE_S = 5.0


@dataclass
class _Running:
    """A node's process. ``began`` (on the monotonic clock) and ``spent`` are what its meter noted."""

    program: NodeProgram
    process: subprocess.Popen[bytes]
    note: Path
    said: Path
    began: Ns = 0
    spent: Ns = 0

    def look(self) -> bool:
        """Whether its ``main`` has begun. ``ComponentError`` if it has ended."""
        if self.process.poll():
            said = self.said.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            last = said[-1] if said else f"exit status {self.process.returncode}"
            raise ComponentError(self.program.instance, f"ended while it was measured: {last}")
        noted = self.note.read_text(encoding="ascii").split() if self.note.exists() else []
        if len(noted) == 2:
            self.began, self.spent = int(noted[0]), int(noted[1])
        return len(noted) == 2

    def cpu(self) -> Ns:
        """CPU time of the process since its ``main`` began."""
        return process_cpu(self.process.pid) - self.spent


def process_cpu(pid: int) -> Ns:
    """What all threads of a process have taken so far, by its own CPU clock (``clock_getcpuclockid(3)``).

    Works for a process that has ended as long as nobody has waited for it.
    """
    return time.clock_gettime_ns((~pid << 3) | 2)


def measure(programs: Sequence[NodeProgram], master: str, duration: Ns) -> dict[str, Ns]:
    """Run all *programs* on the master at that address; what each measured one took in its first *duration*.

    ``ComponentError`` names a node that ends with an error, ``LinkSilent`` one that does not begin.
    """
    with TemporaryDirectory(prefix="volery-measure-") as folder, _nodes(Path(folder), master) as start:
        others = [start(one) for one in programs if not one.measured]
        _begun(others)
        _known(Master(master, "/volery"), others)
        _sleep(SETTLE)
        measured = [start(one) for one in programs if one.measured]
        _begun(measured)
        taken: dict[str, Ns] = {}
        for node in sorted(measured, key=lambda one: one.began):
            _sleep(node.began + duration - time.monotonic_ns())
            taken[node.program.instance] = node.cpu()
            node.look()
        return {one.instance: taken[one.instance] for one in programs if one.measured}


def _sleep(duration: Ns) -> None:
    time.sleep(max(0, duration) / S)


def _begun(nodes: Sequence[_Running]) -> None:
    end = time.monotonic_ns() + READY
    for node in nodes:
        while not node.look():
            if time.monotonic_ns() > end:
                raise LinkSilent(f"{node.program.instance} did not begin within {READY / S:g} s")
            _sleep(GLANCE)


def _known(master: Master, nodes: Sequence[_Running]) -> None:
    """Wait until the master knows them."""
    end = time.monotonic_ns() + READY
    while missing := [one.program.node for one in nodes if not master.find("lookupNode", one.program.node)]:
        if time.monotonic_ns() > end:
            raise LinkSilent(f"{missing[0]} did not join the ROS graph within {READY / S:g} s")
        _sleep(GLANCE)


@contextmanager
def _nodes(folder: Path, master: str) -> Iterator[_Starter]:
    starter = _Starter(folder, {**environment(master), "ROS_LOG_DIR": str(folder)})
    try:
        yield starter
    finally:
        starter.stop()


class _Starter:
    """Starts nodes and stops what it has started."""

    def __init__(self, folder: Path, surroundings: Mapping[str, str]) -> None:
        self._folder, self._surroundings = folder, surroundings
        self._started: list[_Running] = []

    def __call__(self, program: NodeProgram) -> _Running:
        """Start it."""
        note, said = (self._folder / f"{program.instance}.{ending}" for ending in ("meter", "out"))
        with said.open("wb") as output:
            process = subprocess.Popen(
                program.command,
                env={**self._surroundings, "VOLERY_METER": str(note)},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        running = _Running(program, process, note, said)
        self._started.append(running)
        return running

    def stop(self) -> None:
        """With SIGINT, at which alone roscpp says good-bye; harder if that takes long."""
        for one in self._started:
            with suppress(ProcessLookupError):
                os.kill(one.process.pid, signal.SIGINT)
        end = time.monotonic() + GOOD_BYE_S
        for one in self._started:
            try:
                one.process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                one.process.kill()
                one.process.wait()
