"""Components that others started, by the entry points of generated packages, as a run controls them."""

from __future__ import annotations

from functools import partial

from volery.base.errors import ComponentError, UsageError
from volery.base.time import MS, Ns, S
from volery.kernel.virtual import VirtualKernel
from volery.model.system import System
from volery.ros.graph.interface import full_node_name
from volery.ros.transports.transport_graph import TransportGraph
from volery.ros.transports.transport_node import TransportNode
from volery.run.distributed import pipe, plan
from volery.run.distributed.topic_messages import (
    MESSAGE_TYPE,
    QUEUE,
    TO_COMPONENTS,
    TO_RUN,
    from_message,
    is_sent,
    to_message,
)
from volery.run.ending import Ending
from volery.trace.events import WARNING, Text

LEAVE_PERIOD: Ns = 500 * MS
LEAVE_WITHIN: Ns = 60 * S


class DeployedComponent:
    """A component in a process that others started (``host``); its messages come over topics."""

    def __init__(self, name: str, run: DeployedRun) -> None:
        self.name = name
        self.ready = self.begun = False
        self.start_error = ""
        self._run = run

    def check(self) -> None:
        """Raise ``ComponentError`` if the component cannot become ready."""
        if self.start_error:
            raise ComponentError(self.name, self.start_error)

    def go(self) -> None:
        """Start the component; all are ready."""
        self.begun = True
        self._run.send(pipe.Begin())

    def come_to_rest(self) -> None:
        """Stop the component and block until its node has left the graph, or a minute has passed."""
        kernel = self._run.kernel
        end = kernel.now() + LEAVE_WITHIN
        self._run.send(pipe.Stop("its run has ended"))
        while self._run.is_there(self.name) and kernel.now() < end:
            kernel.sleep_until(kernel.now() + LEAVE_PERIOD)
            self._run.send(pipe.Stop("its run has ended"))

    def stop(self) -> bool:
        """Return True: it ends by itself."""
        return True


class DeployedRun:
    """The topics between a run and components that others started."""

    def __init__(self, kernel: VirtualKernel, ending: Ending, graph: TransportGraph, system: System) -> None:
        self.kernel, self._ending, self._graph = kernel, ending, graph
        self._nodes = {
            instance.name: full_node_name(plan.node_label(instance), instance.namespace)
            for instance in plan.worker_instances(system)
        }
        self.components = {name: DeployedComponent(name, self) for name in self._nodes}

    def open(self, node: TransportNode) -> None:
        """Talk to the components from *node*."""
        self._publisher = node.advertise(TO_COMPONENTS, MESSAGE_TYPE, QUEUE)
        node.subscribe(TO_RUN, MESSAGE_TYPE, self._received, QUEUE, node.group(lambda work: work.run()))

    def send(self, message: object) -> None:
        """Send a message to all components."""
        self.kernel.post(partial(self._publisher.publish, to_message("", message)))

    def is_there(self, name: str) -> bool:
        """Return whether the node of a component is on the graph."""
        return self._nodes[name] in self._graph.node_names()

    def _received(self, message: object) -> None:
        try:
            sender, content = from_message(message)
        except UsageError as error:
            self.kernel.record(Text(self.kernel.now(), plan.NODE, WARNING, str(error)))
            return
        component = self.components.get(sender)
        if component is None:
            return
        if isinstance(content, pipe.Ready):
            component.ready = True
            if component.begun:  # it joined late
                self.send(pipe.Begin())
        elif isinstance(content, pipe.EndingBegun):
            if content.status == "failed":
                why = content.why.removeprefix(f"{sender}: ")
                self._ending.failed(sender, ComponentError(sender, why))
        elif isinstance(content, pipe.StartFailed):
            component.start_error = content.why
        elif is_sent(content):
            self.kernel.record(content)
