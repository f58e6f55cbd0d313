"""rospy's exceptions, under its own names.

What one component is to rospy: its node, its helping tasks, whether it is shutting down.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from volery.base.errors import VoleryError
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.kernel.task import Scope
from volery.kernel.waiting import Signal, current_task
from volery.ros.client_libraries.library_base import AtEnd, Launch, LaunchedComponents, Rosout
from volery.ros.graph import LATCHED, Group, Node, RosGraph, Work
from volery.trace.events import Failure, Text


class ROSException(Exception):  # noqa: N818 - rospy's name
    """What rospy raises for time-outs and misuse."""


class ROSInitException(ROSException):
    """A call before ``init_node``."""


class ROSSerializationException(ROSException):
    """A value that does not fit its message's field."""


class ROSInterruptException(ROSException, KeyboardInterrupt):
    """The node is shutting down while it sleeps."""


class ROSTimeMovedBackwardsException(ROSInterruptException):
    """Never raised: time does not move backwards here."""


class ServiceException(Exception):  # noqa: N818 - rospy's name
    """A service call did not succeed."""


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


ERROR = 3
"""Severity, as in syslog."""


@dataclass(eq=False)
class Session:
    """One component's node."""

    graph: RosGraph
    node: Node
    scope: Scope
    kernel: Kernel
    ended: Signal
    rosout: Rosout
    at_end: AtEnd
    shutdown: str = ""
    hooks: list[Callable[[], Any]] = field(default_factory=list)
    failures: set[str] = field(default_factory=set)
    initialised: bool = False

    def say(self, severity: int, text: str) -> None:
        """Record a log line of this node. An interaction point."""
        with self.kernel as kernel:
            kernel.record(Text(kernel.now(), self.node.context.component, severity, text))

    def check(self) -> None:
        """``ROSInterruptException`` if it is shutting down."""
        if self.shutdown:
            raise ROSInterruptException(f"rospy shutdown: {self.shutdown}")

    def on_shutdown(self, hook: Callable[[], Any]) -> None:
        """Call it when the node shuts down, by itself or with the run."""
        if not self.hooks:
            self.at_end(self.node.context, lambda: self.end("the run has ended"))
        self.hooks.append(hook)

    def end(self, why: str) -> None:
        """Shut down: hooks first, then leave the graph."""
        if not self.shutdown:
            self.shutdown = why or "signal_shutdown"
            for hook in self.hooks:
                self._guarded(hook, "shutdown hook")
            self.node.close()
            self.ended.notify()

    def spin_beside(self, label: str, what: str) -> Group:
        """A new group that a task of its own spins, as a thread of rospy would."""
        group = self.node.group()

        def body() -> None:
            while not self.node.closed:
                self._guarded(group.spin_once, what)

        self._start(body, label)
        return group

    def beside(self, body: Callable[[], None], label: str) -> None:
        """Have a task of its own do something, as a thread of rospy would."""
        self._start(lambda: self._guarded(body, label), label)

    def spawn_each(self, label: str, what: str) -> Group:
        """A new group of which each piece of work gets a task of its own."""

        def start(work: Work) -> None:
            self._start(lambda: self._guarded(work.run, what), label)

        return self.node.group(start)

    def _start(self, body: Callable[[], None], label: str) -> None:
        place = replace(self.node.context, deadline=None, on_release=None)
        self.kernel.spawn(body, f"{place.component} ({label})", place, self.scope)

    def _guarded(self, run: Callable[[], object], what: str) -> None:
        """rospy's threads log what a callback raises and go on.

        Here it is a failure of the component, too.
        """
        try:
            run()
        except ROSInterruptException:
            pass
        except Exception as error:
            text = f"{what} raised {_in_words(error)}"
            self.say(ERROR, f"bad callback: {text}")
            if text not in self.failures:
                self.failures.add(text)
                self.kernel.record(Failure(self.kernel.now(), self.node.context.component, text))


def _in_words(error: Exception) -> str:
    if isinstance(error, VoleryError):
        return str(error)
    traceback = error.__traceback__
    while traceback is not None and traceback.tb_next is not None:
        traceback = traceback.tb_next
    where = f" (line {traceback.tb_lineno})" if traceback is not None else ""
    return f"{type(error).__name__}: {error}{where}"


@dataclass(eq=False)
class Sessions(LaunchedComponents):
    """All components of one run that are nodes."""

    _open: dict[str, Session] = field(default_factory=dict, init=False)

    def join(self, name: str, anonymous: bool) -> None:
        """``init_node``: a second call of the same component changes nothing."""
        session = self._open.get(self.component) or self._joined(name, anonymous)
        session.initialised = True

    def _joined(self, name: str, anonymous: bool) -> Session:
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

    def here(self) -> Session:
        """The session of the component that the current task computes for."""
        session = self.find()
        if session is None or not session.initialised:
            raise ROSInitException(f"{self.component}: call rospy.init_node() first")
        return session

    def early(self) -> Session:
        """``here``, for what rospy does before ``init_node`` as well: the component joins the graph now."""
        return self.find() or self._joined(self.component, anonymous=False)

    def find(self) -> Session | None:
        """``here``, or ``None`` before the component has joined the graph."""
        return self._open.get(self.component)

    def now(self) -> Ns:
        """ROS time; an interaction point."""
        return self.here().node.now()
