"""What backends over a ROS graph share: the loop of the commanding node, and what no such node passes on.

The node's own loop, at 10 Hz, is run by the task that waits: process what has arrived (one ``spinOnce``),
then sleep. All execution time is therefore charged to the component whose node this is. Nothing runs in the
background: a set-point is repeated by that loop, or by the caller.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from math import isnan
from typing import Any

from volery.base.errors import LinkError, LinkSilent
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.ros.graph import LoopRate, Node, ServiceError
from volery.ros.graph.work import Work
from volery.vehicles.telemetry import Telemetry

PERIOD: Ns = 100 * MS
ANSWERED_WITHIN: Ns = 6 * S
"""A vehicle node waits up to 5 s for the autopilot's acknowledgement."""
ATTITUDE_WITHIN: Ns = 2 * S
"""The attitude is published several times a second."""


class GraphBackend:
    """Base of the backends over a graph. A subclass sets ``_rate`` when it has joined the graph.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        namespace: namespace of the vehicle's names, such as ``/drone_1``; empty for the root.
    """

    def __init__(self, kernel: Kernel, node: Node, name: str, namespace: str) -> None:
        self.telemetry = Telemetry(kernel, name)
        self.cycle: Action | None = self._spin
        self._kernel = kernel
        self._node = node
        self._namespace = namespace.rstrip("/")
        self._wrong = ""
        self._arrived: deque[Work] = deque()
        self._spinner = node.group()
        self._inbox = node.group(self._arrived.append)
        self._rate: LoopRate

    def _name(self, name: str) -> str:
        return f"{self._namespace}/{name}"

    def _subscribe(self, topic: str, message_type: str, handler: Callable[[Any], None]) -> None:
        self._node.subscribe(self._name(topic), message_type, handler, group=self._inbox)

    # -- the node's loop

    def _spin(self) -> None:
        self.poll()
        self._rate.sleep()

    def poll(self) -> None:
        """Process received messages; all of them are charged as one ``spinOnce``."""
        self._spinner.spin_once(0)
        while self._arrived:
            self._arrived.popleft().run()
        self._update()

    @abstractmethod
    def _update(self) -> None:
        """Update what depends on several messages."""

    def _note_message(self) -> None:
        self.telemetry.note_message(self._kernel.now())
        self.telemetry.changed.notify()

    def _wait_for_attitude(self) -> None:
        until = self._kernel.now() + ATTITUDE_WITHIN
        while isnan(self.telemetry.attitude.roll) and self._kernel.now() < until:
            self._spin()

    def _call(self, client: Any, asked: Any) -> Any | None:
        """Return the response; ``None`` if there was none, which is not a refusal by the autopilot."""
        try:
            response = client.call(asked, within=ANSWERED_WITHIN)
        except ServiceError as error:
            self._wrong = str(error)
            return None
        self._wrong = ""
        return response

    # -- what passes no graph

    @property
    def parameters(self) -> Mapping[str, float] | None:
        """Always ``None``: parameters are not read over a graph."""
        return None

    def failing_checks(self) -> Sequence[str]:
        """Return nothing: arming checks pass as texts, if at all."""
        return ()

    def request_obstacles(self) -> None:
        """Do nothing: a vehicle node publishes range sensors only as its configuration names them."""

    def request_target(self) -> None:
        """Do nothing: the target would need another subscription, with its execution time."""

    def request_mission_progress(self) -> None:
        """Do nothing: what there is of it is subscribed to already."""

    def close(self) -> None:
        """Do nothing: the node belongs to its component."""

    def problem(self) -> LinkError | None:
        """Return what is wrong with the link, as an error to raise."""
        if self._wrong:
            return LinkSilent(self._wrong)
        if self.telemetry.last_message_ns >= 0:
            return None
        return LinkSilent(self._silence())

    @abstractmethod
    def _silence(self) -> str:
        """Return in words that nothing of an autopilot has been received."""
