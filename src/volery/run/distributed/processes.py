"""The worker processes of a run on a real graph, as the run's own process controls them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

from volery.base.errors import ComponentError, LinkSilent, choices
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Signal
from volery.model.system import System
from volery.ros.graph.interface import CLOCK_PERIOD
from volery.ros.transports.client_library import pending_calls
from volery.run.assembly.component_builder import Builder, BuiltComponents, ProcessPart, Truth
from volery.run.assembly.computers import ComputingPlatform
from volery.run.assembly.ros_graphs import open_graph
from volery.run.distributed import pipe, plan
from volery.run.distributed.call_types import call_types
from volery.run.distributed.deployed import DeployedComponent, DeployedRun
from volery.run.distributed.pipe import Pipe
from volery.run.distributed.remote_ports import CallFormats, PortClients, PortServer, ValueCodec
from volery.run.ending import Ending

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet

JOIN_WITHIN_S, EXIT_WITHIN_S, POLL_S = 180.0, 5.0, 0.05
"""Wall seconds: deadlines for joining the graph and for leaving, and the period of polling.

Nine components that start at once on two busy cores take more than a minute to join.
"""
STDERR = 2
"""Components print to standard error: a program may read the standard output of the run."""


class WorkerProcess:
    """Process of one component. A thread receives its messages and posts them to the kernel.

    At the end of a run it is ``Landable``: ``come_to_rest`` makes it land the vehicles that it commands.
    """

    def __init__(
        self, kernel: VirtualKernel, ending: Ending, order: pipe.WorkerOrder, truth: Callable[[str], Truth]
    ) -> None:
        self.name = order.name
        self.ready = False
        self.start_error = ""
        self._kernel, self._ending, self._truth = kernel, ending, truth
        self._gone = Signal(kernel, f"the process of {order.name}")
        self._pipe, theirs = Pipe.pair()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "volery.run.distributed.worker", *map(str, theirs)],
            pass_fds=theirs,
            stdin=subprocess.DEVNULL,
            stdout=STDERR,
            start_new_session=True,  # the run receives Ctrl-C and forwards it
        )
        for descriptor in theirs:
            os.close(descriptor)
        self._pipe.send(order)
        self._reader = threading.Thread(target=self._read, name=f"reader of {order.name}", daemon=True)
        self._reader.start()

    def check(self) -> None:
        """Raise ``ComponentError`` if the component cannot become ready."""
        over = self.over
        if over:
            self._reader.join(EXIT_WITHIN_S)  # the reason is in the pipe before the process ends
        if self.start_error:
            raise ComponentError(self.name, self.start_error.removeprefix(f"{self.name}: "))
        if over:
            raise ComponentError(
                self.name, f"its process ({self.pid}) {_how(self._process.returncode)} before it was ready"
            )

    @property
    def over(self) -> bool:
        """True if the process has ended."""
        return self._process.poll() is not None

    @property
    def pid(self) -> int:
        """Id of the process."""
        return self._process.pid

    def _read(self) -> None:
        with suppress(EOFError):
            while True:
                self._handle(self._pipe.receive())
        self._process.wait()
        self._kernel.post(self._went)

    def _handle(self, said: object) -> None:
        if isinstance(said, pipe.Ready):
            self.ready = True
        elif isinstance(said, pipe.StartFailed):
            self.start_error = said.why
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
        self._pipe.send(pipe.TruthReply(self._truth(vehicle)()))

    def _went(self) -> None:
        self._gone.notify()
        if not self._ending.begun:
            self._fail(f"its process ({self.pid}) {_how(self._process.returncode)}")

    def _fail(self, why: str) -> None:
        self._ending.failed(self.name, ComponentError(self.name, why))

    def go(self) -> None:
        """Start the component; all processes are ready."""
        self._pipe.send(pipe.Begin())

    def come_to_rest(self) -> None:
        """Stop the component and block until its process has ended."""
        self._pipe.send(pipe.Stop("its run has ended"))
        self._gone.wait_for(lambda: self.over)

    def stop(self) -> bool:
        """Close the pipe and kill the process if it still runs. Return False if it had to be killed."""
        running = not self.over
        if running:
            with suppress(ProcessLookupError):
                self._process.kill()
            self._process.wait()
        self._pipe.close()
        self._reader.join(EXIT_WITHIN_S)
        return not running


def _how(code: int) -> str:
    """Describe the exit status of a process."""
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"ended with status {code}"


class GraphSettings(NamedTuple):
    """Graph, pace and seed of the run; whether its components are started by others."""

    graph: str
    pace: float
    seed: int
    deployed: bool = False


class DistributedRun:
    """Components of a run on a real graph, each component of the application in its own process.

    Call ``build``, ``start``, ``go`` and in any case ``close``. A ROS 1 master is started if none answers.
    Raises what ``open_graph`` raises.
    """

    def __init__(
        self, system: System, kernel: VirtualKernel, ending: Ending, settings: GraphSettings
    ) -> None:
        self._apart = plan.worker_instances(system)
        self._kernel, self._ending, self._system, self._settings = kernel, ending, system, settings
        self._processes: Sequence[WorkerProcess | DeployedComponent] = ()
        self._closed = False
        self._built: BuiltComponents
        self._truth: Callable[[str], Truth]
        self.graph = open_graph(kernel, settings.graph, start_master=True, epoch=0)

    def build(self, platform: ComputingPlatform, fleet: SimulatedFleet) -> BuiltComponents:
        """Build the components of the environment, which stay in this process."""
        kernel, system = self._kernel, self._system
        self._node = node = self.graph.node(plan.NODE)
        self._truth = fleet.truth
        self._values = ValueCodec(self._beside)
        self._here = tuple(instance for instance in system.instances if instance.is_environment)
        types = call_types(system) if self._settings.deployed else None
        self._formats = CallFormats(system, self._values, self._beside, types)
        part = ProcessPart(self.graph, self._here, PortClients(kernel, system, node, self._formats))
        builder = Builder(system, kernel, platform, fleet, self._ending, part=part)
        self._built = builder.build("times", self._settings.seed)
        return self._built

    def _beside(self, module: str) -> ModuleType | None:
        """Load a module beside any component: a received value may be of a class that is not loaded yet."""
        files = [
            self._system.file_of(instance.component)
            for instance in self._system.instances
            if instance.component.path
        ]
        found = (self._built.loader.sibling(module, folder) for folder in {file.parent: 0 for file in files})
        return next((one for one in found if one is not None), None)

    def start(self) -> None:
        """Start the processes and wait until all are ready.

        Raises:
            ComponentError: A component cannot be loaded, or its process has ended.
            LinkSilent: Some components are not on the graph by the deadline.
        """
        desk = PortServer(self._kernel, self._node, self._formats, self._kernel.root)
        for model in self._here:
            desk.serve(model, self._built.instances[model.name])
        period = round(CLOCK_PERIOD * max(1.0, self._settings.pace))  # the same rate in wall time at any pace
        self.graph.publish_clock(self._node, period)
        settings = self._settings
        if settings.deployed:
            deployed = DeployedRun(self._kernel, self._ending, self.graph, self._system)
            deployed.open(self._node)
            self._processes = tuple(deployed.components.values())
        else:
            orders = [
                pipe.WorkerOrder(self._system, one.name, settings.graph, settings.seed) for one in self._apart
            ]
            self._processes = [
                WorkerProcess(self._kernel, self._ending, order, self._truth) for order in orders
            ]
        self._ending.vehicles = self._processes
        end = time.monotonic() + JOIN_WITHIN_S
        while late := [process for process in self._processes if not process.ready]:
            for one in late:
                one.check()
            if time.monotonic() > end:
                names = choices([one.name for one in late])
                raise LinkSilent(f"not on the graph within {JOIN_WITHIN_S:g} s: {names}")
            time.sleep(POLL_S)
            if settings.deployed:  # their messages are callbacks
                self._kernel.run(0)

    def go(self) -> None:
        """Let the nodes of this process join the graph while time stands still, then start the processes.

        Raises:
            LinkSilent: Some nodes of this process have not joined the graph by the deadline.
        """
        end = time.monotonic() + JOIN_WITHIN_S
        self._kernel.run(0)
        while joining := pending_calls(self._kernel):
            if time.monotonic() > end:
                names, graph = ", ".join(dict.fromkeys(joining)), self._settings.graph
                raise LinkSilent(
                    f"not on the graph within {JOIN_WITHIN_S:g} s: {names}; check that {graph} answers"
                )
            time.sleep(POLL_S / 10)
            self._kernel.run(0)
        for process in self._processes:
            process.go()

    def close(self) -> list[str]:
        """End all processes and leave the graph. Return the names of components that had to be killed."""
        if self._closed:
            return []
        self._closed = True
        killed = [process.name for process in self._processes if not process.stop()]
        self.graph.close()
        return killed
