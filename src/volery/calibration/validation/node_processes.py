"""How each node of a model is started as a process of its own client library.

One run of a model's nodes on a real master, and what each of them took.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Self

from volery.base.errors import ComponentError, LinkSilent, Location, ModelError
from volery.base.time import MS, Ns, S
from volery.calibration.ros.probe_environment import roscpp_program
from volery.components.cpp.compiler import find_sources
from volery.components.programs import script_or_class
from volery.model.instances import Instance
from volery.model.system import System
from volery.ros.transports.ros1.master import Master, environment
from volery.run.assembly.computers import commanded_by

METERS = Path(str(files("volery.calibration.validation").joinpath("meters")))


@dataclass(frozen=True)
class NodeProgram:
    """A node: ``command`` starts it. One of the environment is started and not ``measured``."""

    instance: str
    node: str
    command: tuple[str, ...]
    measured: bool


def node_programs(system: System) -> tuple[NodeProgram, ...]:
    """Those of all nodes of *system*, the environment's first.

    Compiles what is roscpp. ``ModelError`` for a component that is no node of rospy or roscpp that stands
    alone; ``UsageError`` if roscpp or a compiler is missing.
    """
    for instance in system.instances:
        _check(system, instance)
    made = [_program(system, instance) for instance in system.instances]
    return tuple(sorted(made, key=lambda one: one.measured))


def _check(system: System, instance: Instance) -> None:
    component = instance.component
    if component.language not in ("rospy", "roscpp") or not component.path:
        raise _cannot(instance, f"is {component.language}, and what is measured is nodes of rospy and roscpp")
    if commanded_by(instance):
        raise _cannot(instance, "commands a vehicle, which is nothing that a plain node can do")
    if component.language == "rospy":
        file = system.file_of(component)
        if component.stated_class or script_or_class(file, component.class_name, component.where):
            raise _cannot(instance, "is a class, and what is measured is scripts")


def _cannot(instance: Instance, what: str) -> ModelError:
    return ModelError(f"{instance.name} {what}", where=instance.component.where or Location("", 0))


def _program(system: System, instance: Instance) -> NodeProgram:
    file = system.file_of(instance.component)
    if instance.component.language == "roscpp":
        start: tuple[str, ...] = (str(_compiled(instance, file)),)
    else:
        start = (sys.executable, str(METERS / "rospy.py"), str(file))
    return NodeProgram(
        instance.name,
        f"{instance.namespace.rstrip('/')}/{instance.name}",
        (*start, *_arguments(instance)),
        not instance.is_environment,
    )


def _compiled(instance: Instance, file: Path) -> Path:
    component = instance.component
    sources = [*find_sources(file, component.where).compiled, METERS / "roscpp.cpp"]
    options = component.build
    return roscpp_program(instance.name, sources, options.flags, options.libraries)


def _arguments(instance: Instance) -> Iterator[str]:
    """As roslaunch gives them."""
    yield f"__name:={instance.name}"
    if instance.namespace != "/":
        yield f"__ns:={instance.namespace}"
    for name, other in instance.remap.items():
        yield f"{name}:={other}"
    for name, value in instance.parameters.items():
        yield f"_{name}:={json.dumps(value)}"


MeasuredRun = dict[str, Ns]
"""CPU time of each measured node, by the name of its instance."""

READY: Ns = 30 * S
SETTLE: Ns = S
GLANCE: Ns = 20 * MS
GOOD_BYE_S = 5.0


@dataclass
class _NodeProcess:
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


@contextmanager
def measurement_session(
    programs: Sequence[NodeProgram], master: str, duration: Ns
) -> Iterator[Callable[[], MeasuredRun]]:
    """The nodes of *programs* that are not measured, for as long as the context lasts, on the master at that
    address. What it gives runs the others once, and says what each took in its first *duration*.

    ``ComponentError`` names a node that ends with an error, ``LinkSilent`` one that does not begin.
    """
    with TemporaryDirectory(prefix="volery-measure-") as folder:
        surroundings = {**environment(master), "ROS_LOG_DIR": folder}
        with _NodeProcesses(Path(folder), surroundings) as others:
            started = [others.start(one) for one in programs if not one.measured]
            _wait_started(started)
            _wait_registered(Master(master, "/volery"), started)
            _sleep(SETTLE)
            yield lambda: _run(programs, _NodeProcesses(Path(folder), surroundings), duration)


def _run(programs: Sequence[NodeProgram], nodes: _NodeProcesses, duration: Ns) -> MeasuredRun:
    with nodes:
        started = [nodes.start(one) for one in programs if one.measured]
        _wait_started(started)
        taken: MeasuredRun = {}
        for node in sorted(started, key=lambda one: one.began):
            _sleep(node.began + duration - time.monotonic_ns())
            taken[node.program.instance] = node.cpu()
            node.look()
    return {one.instance: taken[one.instance] for one in programs if one.measured}


def _sleep(duration: Ns) -> None:
    time.sleep(max(0, duration) / S)


def _wait_started(nodes: Sequence[_NodeProcess]) -> None:
    end = time.monotonic_ns() + READY
    for node in nodes:
        while not node.look():
            if time.monotonic_ns() > end:
                raise LinkSilent(f"{node.program.instance} did not begin within {READY / S:g} s")
            _sleep(GLANCE)


def _wait_registered(master: Master, nodes: Sequence[_NodeProcess]) -> None:
    """Wait until the master knows them."""
    end = time.monotonic_ns() + READY
    while missing := [one.program.node for one in nodes if not master.find("lookupNode", one.program.node)]:
        if time.monotonic_ns() > end:
            raise LinkSilent(f"{missing[0]} did not join the ROS graph within {READY / S:g} s")
        _sleep(GLANCE)


class _NodeProcesses:
    """Starts nodes, and stops at the end of its context what it has started."""

    def __init__(self, folder: Path, surroundings: Mapping[str, str]) -> None:
        self._folder, self._surroundings = folder, surroundings
        self._started: list[_NodeProcess] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def start(self, program: NodeProgram) -> _NodeProcess:
        """Start it."""
        note, said = (self._folder / f"{program.instance}.{ending}" for ending in ("meter", "out"))
        note.unlink(missing_ok=True)  # of the run before
        with said.open("wb") as output:
            process = subprocess.Popen(
                program.command,
                env={**self._surroundings, "VOLERY_METER": str(note)},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        running = _NodeProcess(program, process, note, said)
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
