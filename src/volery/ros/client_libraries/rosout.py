"""``/rosout``: what a node logs, as messages, for whoever listens."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.ros.graph import Graph, Node, Publisher, QoS, RosGraph
from volery.ros.messages import message_class

ROSOUT = "/rosout"


class Caller(NamedTuple):
    """Where a line was logged: the file's name, the function and the line."""

    file: str
    function: str
    line: int


def caller(depth: int) -> Caller:
    """Of the call that is *depth* calls above whoever asks."""
    frame = sys._getframe(depth + 1)
    return Caller(Path(frame.f_code.co_filename).name, frame.f_code.co_name, frame.f_lineno)


class Rosout:
    """Publishes a node's lines of the log as messages of one type.

    On the embedded graph it joins the topic only when somebody listens there, so that logging costs nothing
    and shows nowhere else. Where the topic carries another library's type, or the type is not installed, the
    lines are in the log alone.
    """

    def __init__(self, graph: RosGraph, node: Node, message_type: str, qos: QoS) -> None:
        self._graph, self._node, self._type, self._qos = graph, node, message_type, qos
        self._publisher: Publisher | None = None
        self._closed = False

    def tell(self, fill: Callable[[Any], None]) -> None:
        """Publish a message that *fill* completes, if somebody listens. An interaction point if so."""
        if self._closed or self._node.closed or not self._wanted():
            return
        try:
            if self._publisher is None:
                self._publisher = self._node.advertise(ROSOUT, self._type, self._qos)
            message = message_class(self._type)()
            fill(message)
            self._publisher.publish(message)
        except UsageError:
            self._closed = True

    def _wanted(self) -> bool:
        return not isinstance(self._graph, Graph) or self._graph.heard(ROSOUT)
