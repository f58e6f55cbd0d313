"""The process of one component: ``python -m volery.run.distributed.worker IN OUT``, two descriptors of pipes.

It joins the graph as the component's node, follows ``/clock``, says that it is ready and, told to go, does
what the component does until it is told to end. An end brings down the vehicles that it commands. Should the
run's own process be gone, time stands still; then it ends as it is.
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
from volery.components.loader import Loader
from volery.kernel.wall import FollowingKernel
from volery.requirements.record import Status
from volery.run.assembly.components import Builder, BuiltComponents, ProcessPart
from volery.run.assembly.ros_graphs import open_graph
from volery.run.distributed import pipe, plan
from volery.run.distributed.pipe import Pipe
from volery.run.distributed.remote_ports import PortClients, PortServer, ValueCodec
from volery.run.ending import FOREVER, Ending
from volery.trace.events import Activation, Charge, Event

UNREPORTED = (Activation, Charge)
"""Events about computing, which takes this machine's time and not that of the model's processors."""

ORPHAN_S = 10.0
"""On the wall: how long after the loss of its run a process is given to end."""


class _ReportedEnding(Ending):
    """An end that the run hears of as soon as it begins."""

    def __init__(self, kernel: FollowingKernel, run: Pipe) -> None:
        super().__init__(kernel)
        self._run = run

    def begin(self, status: Status, reason: str) -> None:
        """See ``Ending.begin``."""
        if not self.begun:
            self._run.say(pipe.EndingBegun(status, reason))
        super().begin(status, reason)


class Worker:
    """One component on a real graph."""

    def __init__(self, order: pipe.WorkerOrder, run: Pipe) -> None:
        self._order, self._run = order, run
        self._system = order.system
        self._model = order.system.instance(order.name)
        self._kernel = FollowingKernel(self._record)
        self._ending = _ReportedEnding(self._kernel, run)
        self._answers: SimpleQueue[Position] = SimpleQueue()
        self._loader: Loader | None = None
        self.graph = open_graph(self._kernel, order.graph, epoch=0)

    def _record(self, event: Event) -> None:
        if not isinstance(event, UNREPORTED):
            self._run.say(event)

    def join(self) -> BuiltComponents:
        """Onto the graph, loaded and ready to be called. Raises what is wrong with the component."""
        model, kernel = self._model, self._kernel
        node = self.graph.node(plan.node_label(model), model.namespace, remaps=model.remap)
        self.graph.follow_clock(node)
        values = ValueCodec(self._beside)
        reach = PortClients(kernel, self._system, node, values)
        part = ProcessPart(self.graph, (model,), reach, {model.name: node}, self._truth)
        platform = plan.HostPlatform(self._system, kernel, self._order.seed, "times")
        builder = Builder(self._system, kernel, platform, None, self._ending, part=part)
        built = builder.build("times", self._order.seed)
        self._loader = built.loader
        PortServer(kernel, node, values, kernel.root).serve(model, built.instances[model.name])
        return built

    def _beside(self, module: str) -> ModuleType | None:
        assert self._loader is not None, "values arrive when the component is loaded"
        return self._loader.sibling(module, self._system.file_of(self._model.component).parent)

    def live(self, built: BuiltComponents) -> None:
        """From the word to go to the end."""
        threading.Thread(target=self._listen, name="run", daemon=True).start()
        built.start()
        self._kernel.call_at(FOREVER, lambda: None)  # a component that is only called ends when it is told to
        self._ending.pass_time()
        self.graph.close()

    def _truth(self, vehicle: str) -> Callable[[], Position]:
        def look() -> Position:
            self._run.say(pipe.TruthRequest(vehicle))
            return self._answers.get()

        return look

    def _listen(self) -> None:
        try:
            while True:
                said = self._run.hear()
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
    """Do what the order says."""
    run = Pipe(int(sys.argv[1]), int(sys.argv[2]))
    order = run.hear()
    try:
        hosted = Worker(order, run)
        built = hosted.join()
    except VoleryError as error:
        run.say(pipe.StartFailed(str(error)))
        os._exit(1)  # threads of a client library may be left
    run.say(pipe.Ready())
    run.hear()
    hosted.live(built)
    run.close()
    os._exit(0)


if __name__ == "__main__":
    main()
