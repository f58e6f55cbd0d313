"""The process of one component: ``python -m volery.run.distributed.worker IN OUT``, two pipe descriptors.

It joins the graph as the component's node, follows ``/clock``, reports that it is ready, and runs the
component after ``Begin`` until ``Stop``. At the end it lands the vehicles that the component commands. If the
run's own process is gone, time stands still and the process exits after ``ORPHAN_S``.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from types import ModuleType

from volery.base.errors import VoleryError
from volery.base.position import Position
from volery.base.process import outlive_output
from volery.base.time import Ns, S
from volery.components.loader import Loader
from volery.kernel.task import ExecutionContext
from volery.kernel.wall import FollowingKernel, WallKernel
from volery.requirements.record import Status
from volery.ros.graph.unserved import KnownParticipants
from volery.run.assembly.component_builder import Builder, BuiltComponents, ProcessPart
from volery.run.assembly.ros_graphs import open_graph
from volery.run.distributed import pipe, plan
from volery.run.distributed.call_types import CallTypes
from volery.run.distributed.pipe import Pipe, RunSide
from volery.run.distributed.remote_ports import CallFormats, PortClients, PortServer, ValueCodec
from volery.run.ending import FOREVER, Ending
from volery.trace.events import Activation, Charge, Event

UNREPORTED = (Activation, Charge)
"""Events about computing. It takes the time of this machine, not that of the model's processors."""

NOTICE: Ns = S
"""Time between two looks at who takes and gives the topics."""

ORPHAN_S = 10.0
"""Wall seconds between the loss of the run's process and the exit."""


class _ReportedEnding(Ending):
    """Ending that is reported to the run as soon as it begins."""

    def __init__(self, kernel: WallKernel, run: RunSide) -> None:
        super().__init__(kernel)
        self._run = run

    def begin(self, status: Status, reason: str) -> None:
        """See ``Ending.begin``."""
        if not self.begun:
            self._run.send(pipe.EndingBegun(status, reason))
        super().begin(status, reason)


class Worker:
    """One component on a real graph, in the time of ``/clock`` or in real time."""

    def __init__(self, order: pipe.WorkerOrder, run: RunSide, *, real_time: bool = False) -> None:
        self._order, self._run = order, run
        self._system = order.system
        self._model = order.system.instance(order.name)
        self._real_time = real_time
        self._kernel = WallKernel(self._record) if real_time else FollowingKernel(self._record)
        self._ending = _ReportedEnding(self._kernel, run)
        self._answers: SimpleQueue[Position] = SimpleQueue()
        self._loader: Loader | None = None
        self.graph = open_graph(self._kernel, order.graph, epoch=None if real_time else 0)

    def _record(self, event: Event) -> None:
        if not isinstance(event, UNREPORTED):
            self._run.send(event)

    def join(self) -> BuiltComponents:
        """Join the graph and load the component, ready to be called."""
        model, kernel = self._model, self._kernel
        node = self.graph.node(plan.node_label(model), model.namespace, remaps=model.remap)
        if isinstance(kernel, FollowingKernel):
            self.graph.follow_clock(node)
        values = ValueCodec(self._beside)
        formats = CallFormats(self._system, values, self._beside, self._call_types())
        reach = PortClients(kernel, self._system, node, formats)
        part = ProcessPart(self.graph, (model,), reach, {model.name: node}, self._truth_source())
        platform = plan.HostPlatform(self._system, kernel, self._order.seed, "times")
        builder = Builder(self._system, kernel, platform, None, self._ending, part=part)
        built = builder.build("times", self._order.seed)
        self._loader = built.loader
        PortServer(kernel, node, formats, kernel.root).serve(model, built.instances[model.name])
        return built

    def _call_types(self) -> CallTypes | None:
        return None  # processes of one run send JSON

    def _beside(self, module: str) -> ModuleType | None:
        assert self._loader is not None, "values are received after the component is loaded"
        return self._loader.sibling(module, self._system.file_of(self._model.component).parent)

    def live(self, built: BuiltComponents) -> None:
        """Run the component to its end."""
        threading.Thread(target=self._listen, name="run", daemon=True).start()
        self._kernel.spawn(self._notice, "notice", ExecutionContext(plan.NODE))
        try:
            built.start()
        except VoleryError as error:
            self._ending.failed(self._model.name, error)
        self._pass_time()

    def _pass_time(self) -> None:
        self._kernel.call_at(FOREVER, lambda: None)  # keeps a passive component running until Stop
        self._ending.pass_time()
        self._report_unserved()
        self.graph.close()

    def _notice(self) -> None:
        while True:
            self._kernel.sleep_until(self._kernel.now() + NOTICE)
            self.graph.notice()

    def _report_unserved(self) -> None:
        names = (self._model.name, plan.node_label(self._model))
        found = self.graph.unserved(KnownParticipants(names, *plan.vehicles_on_graph(self._system)))
        for one in found:
            self._record(one)

    def _truth_source(self) -> Callable[[str], Callable[[], Position]] | None:
        return self._truth

    def _truth(self, vehicle: str) -> Callable[[], Position]:
        def position() -> Position:
            self._run.send(pipe.TruthRequest(vehicle))
            return self._answers.get()

        return position

    def _listen(self) -> None:
        try:
            while True:
                said = self._run.receive()
                if isinstance(said, pipe.TruthReply):
                    self._answers.put(said.position)
                else:
                    self._end(said.why)
        except EOFError:
            threading.Timer(ORPHAN_S, partial(os._exit, 1)).start()
            self._end("its run is gone")

    def _end(self, why: str) -> None:
        self._kernel.post(partial(self._ending.begin, "interrupted", why))


def main() -> None:
    """Run the component that the first message describes."""
    outlive_output()
    run = Pipe(int(sys.argv[1]), int(sys.argv[2]))
    order = run.receive()
    try:
        worker = Worker(order, run)
        built = worker.join()
    except VoleryError as error:
        run.send(pipe.StartFailed(str(error)))
        os._exit(1)  # threads of a client library may be left
    run.send(pipe.Ready())
    run.receive()
    worker.live(built)
    run.close()
    os._exit(0)


if __name__ == "__main__":
    main()
