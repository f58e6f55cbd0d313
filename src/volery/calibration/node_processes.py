"""Nodes of a model as processes of their own client libraries on a real ROS master, and their CPU time."""

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
from volery.components.cpp.sources import find_sources
from volery.components.programs import script_or_class
from volery.model.instances import Instance
from volery.model.system import System
from volery.ros.transports.ros1.master import Master, environment
from volery.run.assembly.computers import commanded_by

METERS = Path(str(files("volery.calibration").joinpath("meters")))


@dataclass(frozen=True)
class NodeProgram:
    """A node and the command that starts it. Nodes of the environment are not ``measured``."""

    instance: str
    node: str
    command: tuple[str, ...]
    measured: bool


def node_programs(system: System) -> tuple[NodeProgram, ...]:
    """Return the programs of all nodes of a system, the environment's first; compile those of roscpp.

    Raises:
        ModelError: A component is not a stand-alone node of rospy or roscpp.
        UsageError: roscpp or a compiler is missing.
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
        raise _cannot(instance, "commands a vehicle, which a plain node cannot do")
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
    """Yield the arguments of a node as roslaunch gives them."""
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
POLL_PERIOD: Ns = 20 * MS
STOP_TIMEOUT_S = 5.0


@dataclass
class _NodeProcess:
    """A node's process.

    Attributes:
        program: The node.
        process: Its process.
        note: File that its meter writes at the beginning of ``main``.
        output: File with its output.
        began: Beginning of ``main`` on the monotonic clock, ns.
        spent: CPU time of the process before ``main``, ns.
    """

    program: NodeProgram
    process: subprocess.Popen[bytes]
    note: Path
    output: Path
    began: Ns = 0
    spent: Ns = 0

    def has_begun(self) -> bool:
        """Return whether ``main`` has begun; raise ``ComponentError`` if the process has ended."""
        if self.process.poll():
            lines = self.output.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            last = lines[-1] if lines else f"exit status {self.process.returncode}"
            raise ComponentError(self.program.instance, f"ended while it was measured: {last}")
        noted = self.note.read_text(encoding="ascii").split() if self.note.exists() else []
        if len(noted) == 2:
            self.began, self.spent = int(noted[0]), int(noted[1])
        return len(noted) == 2

    def cpu(self) -> Ns:
        """Return the CPU time of the process since the beginning of ``main``, ns."""
        return process_cpu(self.process.pid) - self.spent


def process_cpu(pid: int) -> Ns:
    """Return the CPU time of all threads of a process so far, ns, by ``clock_getcpuclockid(3)``.

    The clock of a process that has ended is valid until the process is waited for.
    """
    return time.clock_gettime_ns((~pid << 3) | 2)


@contextmanager
def measurement_session(
    programs: Sequence[NodeProgram], master: str, duration: Ns
) -> Iterator[Callable[[], MeasuredRun]]:
    """Keep the nodes that are not measured running for the duration of the context.

    Args:
        programs: All nodes.
        master: Address of the ROS master.
        duration: Time from the beginning of ``main`` to the reading of the clock, ns.

    Yields:
        A function that runs the measured nodes once and returns the CPU time of each.

    Raises:
        ComponentError: A node ends with an error.
        LinkSilent: A node does not begin.
    """
    with TemporaryDirectory(prefix="volery-measure-") as folder:
        surroundings = {**environment(master), "ROS_LOG_DIR": folder}
        with _NodeProcesses(Path(folder), surroundings) as others:
            started = [others.start(program) for program in programs if not program.measured]
            _wait_started(started)
            _wait_registered(Master(master, "/volery"), started)
            _sleep(SETTLE)
            yield lambda: _run(programs, _NodeProcesses(Path(folder), surroundings), duration)


def _run(programs: Sequence[NodeProgram], nodes: _NodeProcesses, duration: Ns) -> MeasuredRun:
    with nodes:
        started = [nodes.start(program) for program in programs if program.measured]
        _wait_started(started)
        taken: MeasuredRun = {}
        for node in sorted(started, key=lambda one: one.began):
            _sleep(node.began + duration - time.monotonic_ns())
            taken[node.program.instance] = node.cpu()
            node.has_begun()
    return {program.instance: taken[program.instance] for program in programs if program.measured}


def _sleep(duration: Ns) -> None:
    time.sleep(max(0, duration) / S)


def _wait_started(nodes: Sequence[_NodeProcess]) -> None:
    end = time.monotonic_ns() + READY
    for node in nodes:
        while not node.has_begun():
            if time.monotonic_ns() > end:
                raise LinkSilent(f"{node.program.instance} did not begin within {READY / S:g} s")
            _sleep(POLL_PERIOD)


def _wait_registered(master: Master, nodes: Sequence[_NodeProcess]) -> None:
    """Wait until the nodes are registered at the master."""
    end = time.monotonic_ns() + READY
    while missing := [
        node.program.node for node in nodes if not master.find("lookupNode", node.program.node)
    ]:
        if time.monotonic_ns() > end:
            raise LinkSilent(f"{missing[0]} did not join the ROS graph within {READY / S:g} s")
        _sleep(POLL_PERIOD)


class _NodeProcesses:
    """Starts nodes, and stops those that it has started at the end of its context."""

    def __init__(self, folder: Path, surroundings: Mapping[str, str]) -> None:
        self._folder, self._surroundings = folder, surroundings
        self._started: list[_NodeProcess] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def start(self, program: NodeProgram) -> _NodeProcess:
        """Start the process of a node."""
        note, output = (self._folder / f"{program.instance}.{ending}" for ending in ("meter", "out"))
        note.unlink(missing_ok=True)  # of the run before
        with output.open("wb") as stream:
            process = subprocess.Popen(
                program.command,
                env={**self._surroundings, "VOLERY_METER": str(note)},
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        started = _NodeProcess(program, process, note, output)
        self._started.append(started)
        return started

    def stop(self) -> None:
        """Stop all with SIGINT, which lets roscpp unregister; kill those that do not end."""
        for one in self._started:
            with suppress(ProcessLookupError):
                os.kill(one.process.pid, signal.SIGINT)
        end = time.monotonic() + STOP_TIMEOUT_S
        for one in self._started:
            try:
                one.process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                one.process.kill()
                one.process.wait()
