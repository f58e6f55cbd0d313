"""What a fleet needs of a simulated autopilot, and of the family that creates it.

A package brings an autopilot of its own by an entry point of the group ``volery.autopilots`` that names an
``AutopilotFamily``. ``autopilot.FirmwareFamily`` is that of the firmwares that volery simulates. An autopilot
with an estimator and loops of its own reads the samples in ``Flight.estimate`` and gives
``Flight.drive_motors`` one command for each motor.
"""

from __future__ import annotations

from collections.abc import Mapping, MutableSequence
from typing import NamedTuple, Protocol

from volery.base.installed import Registry
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.links.link import Link, WireFormat
from volery.ros.graph import RosGraph
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.trace.events import VehicleState


class FleetAutopilot(Protocol):
    """The autopilot of one vehicle of a fleet."""

    @property
    def transmitter(self) -> MutableSequence[int]:
        """Pulse widths of the pilot's transmitter [us], channel 1 first; a fleet writes them."""

    @property
    def banner(self) -> bytes:
        """Bytes that the autopilot writes to a new byte connection before any frame."""

    def connect(self, link: Link, *, use: str = "") -> None:
        """Serve *link*, and boot if that has not happened yet.

        Args:
            link: The autopilot's end of the link.
            use: What the firmware uses the link for, such as ``station``; empty: its default.

        Raises:
            UsageError: It is reached over a ROS graph.
        """

    def join(self, graph: RosGraph, namespace: str, place: ExecutionContext) -> None:
        """Serve on a ROS graph, and boot if that has not happened yet.

        Args:
            graph: The graph.
            namespace: Prefix of all names.
            place: Execution context that the node's computing is charged to.

        Raises:
            UsageError: It is reached over links.
        """

    def swap_battery(self) -> None:
        """Fly on a full battery from now on."""

    def state(self) -> VehicleState:
        """Return true and estimated state, mode and arming now, also of one that is closed."""

    def close(self) -> None:
        """End what the autopilot does: timers, links, processes."""


class DefaultLink(NamedTuple):
    """An address to which a firmware connects by default, and what the firmware uses that link for."""

    address: str
    use: str = ""


class AutopilotFamily(Protocol):
    """The autopilots of one project, for all the kinds of vehicles that it has."""

    @property
    def name(self) -> str:
        """Name of the entry point."""

    @property
    def codec(self) -> WireFormat | None:
        """Codec of their links; ``None``: they are reached over a ROS graph."""

    @property
    def default_links(self) -> tuple[DefaultLink, ...]:
        """Links that ``volery vehicle serve`` opens unless addresses are given."""

    @property
    def airframes(self) -> bool:
        """Whether they can be configured for the airframe of a model."""

    def of_version(self, version: str) -> AutopilotFamily:
        """Return the family in one version; the newest if *version* is empty.

        Raises:
            UsageError: There is no such version.
        """

    def with_features(self, names: str) -> AutopilotFamily:
        """Return the family with features that are off by default.

        Args:
            names: Their names with commas between them, or ``all``; empty: none.

        Raises:
            UsageError: There is no such feature.
        """

    def create(
        self,
        kernel: Kernel,
        flight: Flight,
        *,
        system: int = 1,
        parameters: Mapping[str, float] | None = None,
        warm: bool = False,
        name: str = "",
        logging: bool = False,
    ) -> FleetAutopilot:
        """Return the autopilot of a body.

        Args:
            kernel: Clock and timers.
            flight: The body, its sensors and what moves it.
            system: MAVLink system id.
            parameters: Parameter values that replace the firmware's.
            warm: Whether it is booted and has a position before the run begins. A cold autopilot boots when
                its first link is connected, and takes as long as the firmware does.
            name: Name in texts and traces; by default one of the family and the system id.
            logging: Whether flights are recorded as logs on board.

        Raises:
            UsageError: It has no such parameter, or is not for this kind of vehicle.
        """


firmwares: Registry[AutopilotFamily] = Registry("volery.autopilots", "simulated autopilot")
"""Entry points of the group ``volery.autopilots``."""
