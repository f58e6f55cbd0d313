"""State of a component that uses rospy: its node, its helper tasks, and its shutdown; rospy's exceptions."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from volery.base.errors import VoleryError
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.kernel.task import Scope
from volery.kernel.waiting import Signal, current_task, read_clock
from volery.ros.client_libraries.library_base import AtEnd, Launch, LaunchedComponents, Rosout
from volery.ros.graph import LATCHED, Group, Node, RosGraph, Work
from volery.trace.events import Failure, Text

ERROR = 3
"""Severity as in syslog."""


class ROSException(Exception):  # noqa: N818 - rospy's name
    """A time-out or a wrong call."""


class ROSInitException(ROSException):
    """A call before ``init_node``."""


class ROSSerializationException(ROSException):
    """A value does not fit the field of its message."""


class ROSInterruptException(ROSException, KeyboardInterrupt):
    """The node shuts down while it sleeps."""


class ROSTimeMovedBackwardsException(ROSInterruptException):
    """Never raised: simulated time does not move backwards."""


class ServiceException(Exception):  # noqa: N818 - rospy's name
    """A service call has failed."""


EXCEPTIONS = {
    kind.__name__: kind
    for kind in (
        ROSException,
        ROSInitException,
        ROSSerializationException,
        ROSInterruptException,
        ROSTimeMovedBackwardsException,
        ServiceException,
    )
}


@dataclass(eq=False)
class Session:
    """The node of one component and what rospy keeps for it."""

    graph: RosGraph
    node: Node
    scope: Scope
    kernel: Kernel
    ended: Signal
    rosout: Rosout
    at_end: AtEnd
    shutdown: str = ""
    """Reason of the shutdown; empty while the node is not shut down."""
    hooks: list[Callable[[], Any]] = field(default_factory=list)
    failures: set[str] = field(default_factory=set)
    initialised: bool = False

    def log(self, severity: int, text: str) -> None:
        """Record a log line of this node. An interaction point."""
        with self.kernel as kernel:
            kernel.record(Text(kernel.now(), self.node.context.component, severity, text))

    def check(self) -> None:
        """Raise ``ROSInterruptException`` if the node is shutting down."""
        if self.shutdown:
            raise ROSInterruptException(f"rospy shutdown: {self.shutdown}")

    def on_shutdown(self, hook: Callable[[], Any]) -> None:
        """Call *hook* when the node shuts down or the run ends."""
        if not self.hooks:
            self.at_end(self.node.context, lambda: self.end("the run has ended"))
        self.hooks.append(hook)

    def end(self, reason: str) -> None:
        """Shut down: call the hooks, then leave the graph."""
        if not self.shutdown:
            self.shutdown = reason or "signal_shutdown"
            for hook in self.hooks:
                self._guarded(hook, "shutdown hook")
            self.node.close()
            self.ended.notify()

    def wait_for_end(self) -> None:
        """Block until the node shuts down."""
        self.ended.wait_for(lambda: self.shutdown, ends_activation=True)

    def spinning_group(self, label: str, what: str) -> Group:
        """Return a new group that a helper task spins, as a thread of rospy would.

        Args:
            label: Name of the task.
            what: Description of a callback in reports of failures.
        """
        group = self.node.group()

        def body() -> None:
            while not self.node.closed:
                self._guarded(group.spin_once, what)

        self._spawn(body, label)
        return group

    def spawn(self, body: Callable[[], None], label: str) -> None:
        """Run *body* in a helper task, as a thread of rospy would."""
        self._spawn(lambda: self._guarded(body, label), label)

    def spawning_group(self, label: str, what: str) -> Group:
        """Return a new group that runs each piece of work in a task of its own."""

        def start(work: Work) -> None:
            self._spawn(lambda: self._guarded(work.run, what), label)

        return self.node.group(start)

    def _spawn(self, body: Callable[[], None], label: str) -> None:
        context = replace(self.node.context, deadline=None, period=None, on_release=None)
        self.kernel.spawn(body, f"{context.component} ({label})", context, self.scope)

    def _guarded(self, run: Callable[[], object], what: str) -> None:
        """Run a callback. An exception is logged, as in rospy, and is a failure of the component."""
        try:
            run()
        except ROSInterruptException:
            pass
        except Exception as error:
            text = f"{what} raised {_description(error)}"
            self.log(ERROR, f"bad callback: {text}")
            if text not in self.failures:
                self.failures.add(text)
                self.kernel.record(Failure(self.kernel.now(), self.node.context.component, text))


def _description(error: Exception) -> str:
    if isinstance(error, VoleryError):
        return str(error)
    traceback = error.__traceback__
    while traceback is not None and traceback.tb_next is not None:
        traceback = traceback.tb_next
    where = f" (line {traceback.tb_lineno})" if traceback is not None else ""
    return f"{type(error).__name__}: {error}{where}"


@dataclass(eq=False)
class Sessions(LaunchedComponents):
    """Sessions of all components of one run that use rospy."""

    _open: dict[str, Session] = field(default_factory=dict, init=False)

    def join(self, name: str, anonymous: bool) -> None:
        """Execute ``init_node``; a second call of the same component changes nothing."""
        session = self._open.get(self.component) or self._open_session(name, anonymous)
        session.initialised = True

    def _open_session(self, name: str, anonymous: bool) -> Session:
        component = self.component
        task = current_task(self.kernel)
        launch = self.launch_of(component)
        label = re.sub(r"\W", "_", name if launch is None else component)
        anonymous = anonymous and launch is None
        launch = launch or Launch()
        node = self.node_of(component) or self.graph.node(
            label, launch.namespace, remaps=launch.remaps, anonymous=anonymous
        )
        for key, value in launch.parameters.items():
            node.set_parameter(f"~{key}", value)
        ended = Signal(self.kernel, f"{component} (rospy.spin)")
        rosout = Rosout(self.graph, node, "rosgraph_msgs/msg/Log", LATCHED)
        made = self._open[component] = Session(
            self.graph, node, task.scope, self.kernel, ended, rosout, self.at_end
        )
        return made

    def initialised(self) -> Session:
        """Return the session of the current component; raise ``ROSInitException`` before ``init_node``."""
        session = self.find()
        if session is None or not session.initialised:
            raise ROSInitException(f"{self.component}: call rospy.init_node() first")
        return session

    def joined(self) -> Session:
        """Return the session of the current task's component, joining the graph if it has not yet.

        For the functions that rospy allows before ``init_node``.
        """
        return self.find() or self._open_session(self.component, anonymous=False)

    def find(self) -> Session | None:
        """Return the session of the current task's component, or None before it has joined the graph."""
        return self._open.get(self.component)

    def now(self) -> Ns:
        """Return ROS time. An interaction point."""
        node = self.initialised().node
        read_clock(self.kernel)
        return node.now()
