"""The graph of a ROS master."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable
from typing import Any

from volery.base.errors import LinkError, UsageError
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.ros.graph.embedded_graph import record_all
from volery.ros.graph.graph_context import Records
from volery.ros.graph.interface import ServiceState, TopicState
from volery.ros.messages.ros1 import our_name
from volery.ros.transports.ros1.master import (
    URI_VARIABLE,
    Master,
    Roscore,
    TopicTypes,
    master_answers,
    uri_of_master,
)
from volery.ros.transports.ros1.rospy_node import Ros1Node, is_reachable
from volery.ros.transports.transport_graph import TransportGraph

WATCH_S = 1.0
LOGGERS = ("rosout", "rospy")


class _ToTrace(logging.Handler):
    """Handler that reports rospy's warnings, such as a peer's other type, which only its log has."""

    def __init__(self, say: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        """Report the text of a record without its traceback."""
        text = record.getMessage().strip().partition("Traceback")[0].rstrip(": \n")
        topic = record.threadName or ""  # what connects a subscriber is named after its topic
        self._say(f"{topic}: {text}" if topic.startswith("/") else text)


class Ros1Library:
    """See ``volery.ros.transports.client_library.ClientLibrary``.

    A thread watches the master: after a restart the master has lost all registrations, and the nodes of this
    process register again.
    """

    def __init__(self, master: Master, core: Roscore | None) -> None:
        self._master, self._core = master, core
        self._types = TopicTypes(master)
        self._wires: list[Ros1Node] = []
        self._guard = threading.Lock()
        self._over = threading.Event()
        self._log: _ToTrace | None = None
        self.say: Callable[[str], None] = lambda text: None

    def start(self) -> None:
        """Start watching the master and rospy's log."""
        self._log = _ToTrace(self._pass_on)
        for name in LOGGERS:
            logging.getLogger(name).addHandler(self._log)
            logging.getLogger(name).propagate = False
        threading.Thread(target=self._watch, name="ROS master", daemon=True).start()

    def _pass_on(self, text: str) -> None:
        self.say(text)

    def join(self, name: str, namespace: str, lost: Callable[[str], None]) -> Ros1Node:
        """Create and register a node."""
        made = Ros1Node(self._types, name, namespace, lost)
        with self._guard:
            self._wires.append(made)
        return made

    def _watch(self) -> None:
        there = True
        while not self._over.wait(WATCH_S):
            found = is_reachable(self._master)
            if there and not found:
                self.say(f"the ROS master at {self._master.uri} does not answer any more")
            there = found
            if found:
                self._register_again()

    def _register_again(self) -> None:
        with self._guard:
            self._wires = [wire for wire in self._wires if not wire.closed]
            wires = list(self._wires)
        for wire in wires:
            try:
                if not wire.known():
                    wire.register_again()
                    self.say(f"{wire.name}: registered again at {self._master.uri}")
            except LinkError as error:
                self.say(f"{wire.name}: {error}")

    def _state(self) -> tuple[dict[str, str], list[Any]]:
        kinds = {name: our_name(kind) for name, kind in self._master.value("getTopicTypes")}
        return kinds, self._master.value("getSystemState")

    def node_names(self) -> list[str]:
        """Return the nodes that are registered for anything, sorted."""
        _, state = self._state()
        return sorted({node for part in state for _, nodes in part for node in nodes})

    def topics(self) -> list[TopicState]:
        """Return the registered topics, by name."""
        kinds, (publishers, subscribers, _) = self._state()
        sending = {name: tuple(sorted(nodes)) for name, nodes in publishers}
        hearing = {name: tuple(sorted(nodes)) for name, nodes in subscribers}
        every = sorted({*sending, *hearing})
        return [
            TopicState(one, kinds.get(one, ""), sending.get(one, ()), hearing.get(one, ())) for one in every
        ]

    def services(self) -> list[ServiceState]:
        """Return the registered services, by name; their types are empty, since the master has none."""
        _, (_, _, services) = self._state()
        return [ServiceState(name, "", nodes[0] if nodes else "") for name, nodes in sorted(services)]

    def announce_clock(self) -> None:
        """Set ``/use_sim_time``, which every node reads when it starts."""
        self._master.value("setParam", "/use_sim_time", True)

    def close(self) -> None:
        """Stop watching the master, and the roscore if this process started it."""
        self._over.set()
        if self._log is not None:
            for name in LOGGERS:
                logging.getLogger(name).removeHandler(self._log)
        if self._core is not None:
            self._core.stop()


def ros1_graph(
    kernel: Kernel,
    *,
    master: str = "",
    start_master: bool = True,
    records: Records = record_all,
    epoch: Ns | None = None,
) -> TransportGraph:
    """Return the graph of a ROS master.

    Args:
        kernel: Clock and tasks of the nodes.
        master: URI of the master; empty for ``ROS_MASTER_URI`` or ROS's default.
        start_master: Start ``roscore`` if no master answers, and stop it in ``close``.
        records: Topics whose messages are recorded with their content.
        epoch: ROS time at the kernel's zero, ns; by default the Unix time then.

    Raises:
        LinkSilent: no master answers, and none is to be started.
        UsageError: this process uses another master already.
    """
    uri = master or uri_of_master()
    _claim(uri)
    core = None
    if not master_answers(uri):
        if start_master:
            core = Roscore(uri)
            core.start()
        else:
            Master(uri, "/volery").value("getPid")
    library = Ros1Library(Master(uri, "/volery"), core)
    made = TransportGraph(kernel, library, records=records, epoch=epoch)
    library.say = made.warn
    library.start()
    return made


_claimed: list[str] = []


def _claim(uri: str) -> None:
    """Set the master's address for rospy, which reads it from the environment at each request."""
    if _claimed and _claimed[0] != uri:
        raise UsageError(
            f"this process is on the ROS master at {_claimed[0]}; rospy cannot talk to {uri} as well: "
            f"use another process"
        )
    _claimed[:] = [uri]
    os.environ[URI_VARIABLE] = uri
