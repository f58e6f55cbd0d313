"""What a simulated autopilot is to one protocol, on any number of links or as a node on a ROS graph.

The protocols that are checked at run time stand apart from what uses them, because a compiled module cannot
define such a class.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from volery.kernel.api import Action
from volery.kernel.task import ExecutionContext
from volery.links.link import Link
from volery.ros.graph import RosGraph


class VehicleOutput(Protocol):
    """What the parts of an autopilot send; each endpoint implements it in its protocol."""

    def send_text(self, severity: int, text: str) -> None:
        """Send a status text; severity as in syslog."""

    def parameter_changed(self, name: str) -> None:
        """Report the new value of a parameter."""

    def mode_changed(self) -> None:
        """Report that another mode is in force."""

    def home_changed(self) -> None:
        """Report the new home position."""

    def send_message(self, message: str) -> None:
        """Send that message of the firmware's protocol now, on all links."""

    def send_event(self, message: str, fields: dict[str, Any]) -> None:
        """Send an event with these fields, on all links."""

    def after_reply(self, action: Action) -> None:
        """Run *action* once the message in hand has been answered; at once if there is none."""


class ProtocolEndpoint(VehicleOutput, Protocol):
    """One vehicle's protocol."""

    def start(self) -> None:
        """Start what is sent regularly, at the phase of the boot."""

    def stop(self) -> None:
        """Stop sending: the vehicle was switched off."""

    def close(self) -> None:
        """Close all links or the node."""


@runtime_checkable
class LinkEndpoint(ProtocolEndpoint, Protocol):
    """A protocol on links."""

    @property
    def banner(self) -> bytes:
        """Bytes that the autopilot writes to a new byte connection before any frame."""

    def connect(self, link: Link, use: str = "") -> None:
        """Serve *link*.

        Args:
            link: The autopilot's end of the link.
            use: What the firmware uses the link for; empty: its default.
        """

    def disconnect(self, link: Link) -> None:
        """Stop serving *link*."""


@runtime_checkable
class GraphEndpoint(ProtocolEndpoint, Protocol):
    """A protocol of topics and services on a ROS graph."""

    def join(self, graph: RosGraph, namespace: str, place: ExecutionContext) -> None:
        """Serve on *graph*.

        Args:
            graph: The graph.
            namespace: Prefix of all names.
            place: Execution context that the node's computing is charged to.
        """
