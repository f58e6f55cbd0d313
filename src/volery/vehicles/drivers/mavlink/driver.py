"""How a MAVLink autopilot's driver is opened: on a link, or behind a vehicle node with MAVROS's names.

Sequences of steps that are the same for every MAVLink autopilot. A firmware's driver adds its own.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from volery.base.errors import CapabilityError, LinkError
from volery.base.geoid import Geoid
from volery.base.time import Ns, S
from volery.kernel.api import Action, Kernel
from volery.links.link import Link
from volery.ros.graph import Node
from volery.vehicles.address import MAVLINK_OPTIONS, check_options
from volery.vehicles.driver import Capability, Repeat, Step
from volery.vehicles.drivers.mavlink import backend as key
from volery.vehicles.drivers.mavlink.backend import Backend, Item
from volery.vehicles.drivers.mavlink.mavros_backend import namespace_and_geoid
from volery.vehicles.drivers.steps import (
    ANSWERED_WITHIN,
    ARMED_WITHIN,
    ROVER_NEAR_M,
    Takeover,
    at_rest,
    horizontal_distance,
    ready_step,
    send_nothing,
)
from volery.vehicles.mission import MissionItem
from volery.vehicles.telemetry import Telemetry

D = TypeVar("D")


@dataclass(frozen=True)
class DriverOpeners(Generic[D]):
    """Of the autopilot called ``name``: its ``driver``, and what carries it over either way."""

    name: str
    driver: Callable[[Kernel, str, Any], D]
    mavlink: Callable[[Kernel, Link, str, Mapping[str, str]], Any]
    mavros: Callable[[Kernel, Node, str, str, Geoid], Any]

    def on_link(self, kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> D:
        """One behind a MAVLink *link*. It begins to listen and to send heartbeats at once.

        Options: ``rate`` of the position and ``attitude`` in Hz, ``system`` id; and ``texts=unrecorded``
        where the autopilot records its texts itself, as a simulated one does.
        """
        check_options(self.name, options, *MAVLINK_OPTIONS)
        return self.driver(kernel, name, self.mavlink(kernel, link, name, options))

    def on_graph(self, kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> D:
        """One behind a vehicle node with MAVROS's names, commanded by *node*.

        Options: ``namespace`` of the vehicle node (else ``/`` and *name*), ``geoid``: ``egm96`` or metres.
        """
        where = namespace_and_geoid(self.name, name, options)
        return self.driver(kernel, name, self.mavros(kernel, node, name, *where))


CHECKS_PERIOD: Ns = 10 * S

ROVER_CAPABILITIES = frozenset(
    {
        Capability.GOTO,
        Capability.SPEED,
        Capability.RETURN_HOME,
        Capability.HOLD,
        Capability.MANUAL_CONTROL,
        Capability.MISSION,
    }
)
DRONE_CAPABILITIES = ROVER_CAPABILITIES | {
    Capability.TAKEOFF,
    Capability.VELOCITY,
    Capability.HEADING,
    Capability.LAND,
    Capability.STABILIZE,
    Capability.ALTITUDE_HOLD,
}
_CAPABILITIES = {"drone": DRONE_CAPABILITIES, "rover": ROVER_CAPABILITIES}
_NONE: frozenset[Capability] = frozenset()


class MavlinkDriver:
    """What drivers over a ``Backend`` share. See ``vehicles.driver.Driver`` for what the methods mean."""

    obeys = ""
    """The mode in which the firmware obeys a computer."""

    def __init__(self, kernel: Kernel, name: str, carrier: Backend) -> None:
        self.name = name
        self.telemetry = carrier.telemetry
        self._carrier = carrier
        self._eviction = Takeover(kernel, carrier.telemetry, self.obeys)
        self._last_item: int | None = None  # where the mission on board ends in the air

    @property
    def capabilities(self) -> frozenset[Capability]:
        """By the kind of vehicle; none until it has been heard."""
        return _CAPABILITIES.get(self.telemetry.kind, _NONE)

    @property
    def offboard_mode(self) -> str:
        """The mode in which it obeys; words that are no mode while somebody else has it there."""
        return self._eviction.offboard_mode

    @property
    def cycle(self) -> Action | None:
        """The carrier's."""
        return self._carrier.cycle

    def poll(self) -> None:
        """Take in what has arrived."""
        self._carrier.poll()

    def problem(self) -> LinkError | CapabilityError | None:
        """What is wrong with the way to the autopilot, or with what is there."""
        return self._carrier.problem()

    @abstractmethod
    def stop(self) -> None:
        """Let go of sticks and of set-points that are being repeated."""

    def close(self) -> None:
        """Stop talking and let go of the link."""
        self.stop()
        self._eviction.end()
        self._carrier.close()

    # -- on the ground

    def ready(self, within: Ns) -> Sequence[Step]:
        """Until the arming checks pass and there is a position."""
        advice = "give it a view of the sky, stand it still and level, and look at its arming checks"
        return (ready_step(within, advice, Repeat(CHECKS_PERIOD, self._carrier.check)),)

    def arm(self) -> Sequence[Step]:
        """In the mode it is in."""
        step = Step(
            ask="arm",
            send=self._arm,
            done=lambda seen: seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.ARM,
            again=2 * S,
        )
        return (step,)

    def _arm(self) -> None:
        """By now its firmware has told its version."""
        problem = self._carrier.problem()
        if isinstance(problem, CapabilityError):
            raise CapabilityError(f"{self.name}: {problem}")
        self._carrier.arm(True)

    def disarm(self, force: bool) -> Sequence[Step]:
        """In the air it is refused without *force*."""
        step = Step(
            ask="disarm",
            send=lambda: self._carrier.arm(False, force=force),
            done=lambda seen: not seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.ARM,
            again=2 * S,
        )
        return (step,)

    # -- missions

    @abstractmethod
    def _items(self, mission: Sequence[MissionItem]) -> list[Item]:
        """The mission as the firmware wants it."""

    def upload(self, mission: Sequence[MissionItem]) -> Sequence[Step]:
        """By MAVLink's mission protocol."""
        items = self._items(mission)
        step = Step(
            ask=f"take a mission of {len(items)} items",
            send=lambda: self._carrier.upload(items),
            done=lambda seen: key.MISSION in seen.answers and seen.answers[key.MISSION].accepted,
            within=30 * S + len(items) * S,
            answer=key.MISSION,
            again=2 * S,
        )
        self._last_item = self._ends_at(mission)
        return (step,)

    @abstractmethod
    def _ends_at(self, mission: Sequence[MissionItem]) -> int | None:
        """The number on the wire of the item with which it ends in the air; ``None`` if it ends otherwise."""

    def _finish_mission(self, mode: str, leads_to: tuple[str, ...], within: Ns) -> Step:
        """To its end: disarmed, at the last point, or said to be over."""
        return Step(
            ask="finish the mission",
            send=self._carrier.watch_mission,
            done=self._mission_over,
            within=within,
            mode=mode,
            leads_to=leads_to,
        )

    def _forget_progress(self) -> None:
        self.telemetry.mission_reached = -1
        self.telemetry.mission_ended = False

    def _mission_over(self, seen: Telemetry) -> bool:
        last = self._last_item
        return not seen.armed or seen.mission_ended or (last is not None and seen.mission_reached >= last)

    # -- pieces of sequences

    @abstractmethod
    def _asks_for(self, mode: str) -> None:
        """This mode is about to be commanded."""

    def _change(self, mode: str) -> Sequence[Step]:
        def send() -> None:
            self._asks_for(mode)
            self._carrier.set_mode(mode)

        if self.telemetry.mode == mode:
            self._asks_for(mode)  # the step will be skipped
        step = Step(
            ask=f"change to {mode}",
            send=send,
            done=lambda seen: seen.mode == mode,
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=key.MODE,
            again=S,
            enters=mode,
        )
        return (step,)

    def _comes_home(self, mode: str, resting: str, within: Ns) -> Step:
        """A rover in *mode*, until it stands near home; there it may go over to *resting*."""

        def home(seen: Telemetry) -> bool:
            return (
                seen.home is not None and horizontal_distance(seen.position, seen.home) <= ROVER_NEAR_M + 1.0
            )

        return Step(
            ask="return home",
            send=send_nothing,
            done=lambda seen: home(seen) and at_rest(seen),
            within=within,
            mode=mode,
            leads_to=(resting,),
            armed=True,
        )

    def _at_speed(self, speed: float, mode: str) -> Sequence[Step]:
        step = Step(
            ask=f"go at {speed:g} m/s",
            send=lambda: self._carrier.speed(speed),
            done=lambda seen: key.SPEED in seen.answers and seen.answers[key.SPEED].accepted,
            within=ANSWERED_WITHIN,
            answer=key.SPEED,
            again=S,
            mode=mode,
        )
        return (step,)
