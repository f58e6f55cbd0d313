"""The processes of a run on a real graph, as the run's own process sees them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

from volery.base.errors import ComponentError, LinkSilent, choices
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Signal
from volery.model.system import System
from volery.ros.graph.interface import CLOCK_PERIOD
from volery.ros.transports.blocking_calls import pending_calls
from volery.run.assembly.components import Builder, BuiltComponents, ProcessPart, Truth
from volery.run.assembly.computers import Platform
from volery.run.assembly.ros_graphs import open_graph
from volery.run.distributed import pipe, plan
from volery.run.distributed.pipe import Pipe
from volery.run.distributed.remote_ports import PortClients, PortServer, ValueCodec
from volery.run.ending import Ending

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet

READY_S, GONE_S, GLANCE_S = 60.0, 5.0, 0.05
STDERR = 2
"""What a component prints goes there: the run's own output may be read by a program."""


class WorkerProcess:
    """One component's process. What it says arrives in a thread and is handed to the kernel.

    To the end of a run it is what a vehicle is: ``come_to_rest`` lets it bring down those that it commands.
    """

    def __init__(
        self, kernel: VirtualKernel, ending: Ending, order: pipe.WorkerOrder, truth: Callable[[str], Truth]
    ) -> None:
        self.name = order.name
        self.ready = False
        self.unfit = ""
        self._kernel, self._ending, self._truth = kernel, ending, truth
        self._gone = Signal(kernel, f"the process of {order.name}")
        self._pipe, theirs = Pipe.pair()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "volery.run.distributed.worker", *map(str, theirs)],
            pass_fds=theirs,
            stdin=subprocess.DEVNULL,
            stdout=STDERR,
            start_new_session=True,  # a Ctrl-C at the terminal is the run's, who tells it
        )
        for descriptor in theirs:
            os.close(descriptor)
        self._pipe.say(order)
        self._reader = threading.Thread(target=self._read, name=f"hears {order.name}", daemon=True)
        self._reader.start()

    def check(self) -> None:
        """Raise ``ComponentError`` if it will never be ready."""
        if self.unfit:
            raise ComponentError(self.name, self.unfit.removeprefix(f"{self.name}: "))
        if self.over:
            raise ComponentError(
                self.name, f"its process ({self.pid}) {_how(self._process.returncode)} before it was ready"
            )

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self._process.poll() is not None

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def _read(self) -> None:
        with suppress(EOFError):
            while True:
                self._hear(self._pipe.hear())
        self._process.wait()
        self._kernel.post(self._went)

    def _hear(self, said: object) -> None:
        if isinstance(said, pipe.Ready):
            self.ready = True
        elif isinstance(said, pipe.StartFailed):
            self.unfit = said.why
        elif isinstance(said, pipe.EndingBegun):
            self._kernel.post(partial(self._ends, said))
        elif isinstance(said, pipe.TruthRequest):
            self._kernel.post(partial(self._tell_truth, said.vehicle))
        else:
            self._kernel.post(partial(self._kernel.record, said))

    def _ends(self, said: pipe.EndingBegun) -> None:
        if said.status == "failed":
            self._fail(said.why.removeprefix(f"{self.name}: "))

    def _tell_truth(self, vehicle: str) -> None:
        self._pipe.say(pipe.TruthReply(self._truth(vehicle)()))

    def _went(self) -> None:
        self._gone.notify()
        if not self._ending.begun:
            self._fail(f"its process ({self.pid}) {_how(self._process.returncode)}")

    def _fail(self, why: str) -> None:
        self._ending.failed(self.name, ComponentError(self.name, why))

    def go(self) -> None:
        """All are ready."""
        self._pipe.say(pipe.Begin())

    def come_to_rest(self) -> None:
        """Let it end, and wait until it has."""
        self._pipe.say(pipe.Stop("its run has ended"))
        self._gone.wait_for(lambda: self.over)

    def stop(self) -> bool:
        """End it, hard if need be; False if it was still there."""
        there = not self.over
        if there:
            with suppress(ProcessLookupError):
                self._process.kill()
            self._process.wait()
        self._pipe.close()
        self._reader.join(GONE_S)
        return not there


def _how(code: int) -> str:
    """How a process ended, in words."""
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"ended with status {code}"


class GraphSettings(NamedTuple):
    """On which graph components are to be, at which pace, with which seed."""

    graph: str
    pace: float
    seed: int


class DistributedRun:
    """A run's components on a real graph, each of the application's in a process of its own.

    Raises what ``open_graph`` raises; a ROS 1 master is started where none answers. ``build`` what stays in
    this process, ``start``, and in any case ``close``.
    """

    def __init__(self, system: System, kernel: VirtualKernel, ending: Ending, order: GraphSettings) -> None:
        self._apart = plan.worker_instances(system)
        self._kernel, self._ending, self._system, self._order = kernel, ending, system, order
        self._processes: list[WorkerProcess] = []
        self._closed = False
        self._built: BuiltComponents
        self._truth: Callable[[str], Truth]
        self.graph = open_graph(kernel, order.graph, start_master=True, epoch=0)

    def build(self, platform: Platform, fleet: SimulatedFleet) -> BuiltComponents:
        """The components of the environment. Raises what is wrong with them, or with the graph."""
        kernel, system = self._kernel, self._system
        self._node = node = self.graph.node(plan.NODE)
        self._truth = fleet.truth
        self._values = ValueCodec(self._beside)
        self._here = tuple(one for one in system.instances if one.is_environment)
        part = ProcessPart(self.graph, self._here, PortClients(kernel, system, node, self._values))
        builder = Builder(system, kernel, platform, fleet, self._ending, part=part)
        self._built = builder.build("times", self._order.seed)
        return self._built

    def _beside(self, module: str) -> ModuleType | None:
        """Of all components: what one sends, this process may not have loaded yet."""
        files = [self._system.file_of(one.component) for one in self._system.instances if one.component.path]
        found = (self._built.loader.sibling(module, folder) for folder in {file.parent: 0 for file in files})
        return next((one for one in found if one is not None), None)

    def start(self) -> None:
        """Start the processes and wait until all are ready.

        Raises ``ComponentError`` for one that cannot begin, ``LinkSilent`` if they take too long.
        """
        desk = PortServer(self._kernel, self._node, self._values, self._kernel.root)
        for model in self._here:
            desk.serve(model, self._built.instances[model.name])
        period = round(CLOCK_PERIOD * max(1.0, self._order.pace))  # on the wall as often, whatever the pace
        self.graph.tell_clock(self._node, period)
        for model in self._apart:
            order = pipe.WorkerOrder(self._system, model.name, self._order.graph, self._order.seed)
            self._processes.append(WorkerProcess(self._kernel, self._ending, order, self._truth))
        self._ending.vehicles = self._processes
        end = time.monotonic() + READY_S
        while late := [one for one in self._processes if not one.ready]:
            for one in late:
                one.check()
            if time.monotonic() > end:
                names = choices([one.name for one in late])
                raise LinkSilent(f"not on the graph within {READY_S:g} s: {names}")
            time.sleep(GLANCE_S)

    def go(self) -> None:
        """Let the nodes of this process join while time stands still; then let the processes begin."""
        end = time.monotonic() + READY_S
        self._kernel.run(0)
        while pending_calls(self._kernel) and time.monotonic() < end:
            time.sleep(GLANCE_S / 10)
            self._kernel.run(0)
        for process in self._processes:
            process.go()

    def close(self) -> list[str]:
        """Leave nothing behind, once; returns the names of components that had to be ended hard."""
        if self._closed:
            return []
        self._closed = True
        stubborn = [one.name for one in self._processes if not one.stop()]
        self.graph.close()
        return stubborn
