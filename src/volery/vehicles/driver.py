"""What a driver is: facts that it keeps, and for each operation the steps that its autopilot wants.

A driver answers with data and never waits; ``perform`` runs the steps of every driver for every vehicle. So
time-outs, refusals, starting over, takeover and fences exist once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, Protocol

from volery.base.errors import CapabilityError, LinkError
from volery.base.position import Position
from volery.base.registry import Registry
from volery.base.time import Ns
from volery.kernel.api import Action, Kernel
from volery.links.link import Codec
from volery.links.mavlink_codec import MAVLINK
from volery.vehicles.mission import MissionItem
from volery.vehicles.telemetry import Telemetry, Velocity


class Capability(Enum):
    """What a vehicle may be asked for. A driver states which of these its autopilot can do."""

    TAKEOFF = "take off"
    GOTO = "go to a position"
    SPEED = "go at a stated speed"
    VELOCITY = "follow a velocity"
    HEADING = "turn to a heading"
    RETURN_HOME = "return home"
    LAND = "land"
    HOLD = "hold its place"
    STICKS = "be flown by sticks"
    STABILIZE = "fly stabilized"
    ALTITUDE_HOLD = "hold its altitude"
    MISSION = "fly an uploaded mission"
    TERRAIN = "keep an altitude above ground"


class Repeat(NamedTuple):
    """Something that is done each ``period``."""

    period: Ns
    action: Action


def _never() -> str:
    return ""


@dataclass(frozen=True, kw_only=True)
class Step:
    """One thing asked of an autopilot, and how one sees that it is done.

    ``send`` asks. It and every other function here never blocks, unless the driver has a cycle. ``done``
    looks at the telemetry; where ``skippable``, a step that is done already is not asked for. ``answer`` is
    the key of the acknowledgement that counts (``Telemetry.answers``). ``again`` asks once more at this
    period: until the answer, or, where the autopilot gives none, until it is done.

    ``enters`` is the mode that this step commands. ``mode`` is the mode in which it must stay while it goes
    on, ``leads_to`` modes which the autopilot may choose by itself in the course of it, ``armed`` whether
    it must stay armed.

    ``lost`` says how somebody else has changed what was asked, where the mode does not tell; empty if nobody
    has.

    ``keep`` is sent all the while. ``advice`` says what the user can do if it is refused or late.
    """

    ask: str
    send: Action
    done: Callable[[Telemetry], bool]
    within: Ns
    skippable: bool = False
    answer: str = ""
    again: Ns | None = None
    enters: str = ""
    mode: str = ""
    leads_to: tuple[str, ...] = ()
    armed: bool = False
    lost: Callable[[], str] = _never
    keep: Repeat | None = None
    advice: str = ""


class ManualControl(NamedTuple):
    """The four sticks: pitch (forward +), roll (right +), yaw (clockwise +) in -1..1, throttle in 0..1.

    In altitude hold a throttle of 0.5 keeps the altitude. A rover takes roll for steering and throttle from
    -1 (back) to 1.
    """

    pitch: float = 0.0
    roll: float = 0.0
    throttle: float = 0.5
    yaw: float = 0.0


class Driver(Protocol):
    """Talks to one autopilot. Each operation answers with the steps to perform, in order.

    ``handover`` is the mode in which the autopilot obeys a computer: a pilot hands over by choosing it.
    ``comes_down`` are the modes in which a drone is on its way to the ground by itself.
    ``cycle`` is for carriers that are nodes of a graph: one round of the node's own loop, which takes in what
    has arrived and sleeps for its period. Whoever waits goes round in its own task, which pays for it.
    """

    name: str
    telemetry: Telemetry
    comes_down: frozenset[str]

    @property
    def handover(self) -> str:
        """See above."""

    @property
    def capabilities(self) -> frozenset[Capability]:
        """What this vehicle can be asked for; empty until it has been heard."""

    @property
    def cycle(self) -> Action | None:
        """``None`` where what arrives is taken in by itself."""

    def look(self) -> None:
        """Take in what has arrived, without waiting."""

    def ready(self, within: Ns) -> Sequence[Step]:
        """Until it could arm and go by position."""

    def arm(self) -> Sequence[Step]:
        """In the mode it is in."""

    def disarm(self, force: bool) -> Sequence[Step]:
        """*force* stops the motors in the air, too."""

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """To *height* metres above home; the whole sequence from the ground and disarmed."""

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """To *goal* (AMSL, above home or, with ``Capability.TERRAIN``, above ground) at *speed* m/s."""

    def hold(self) -> Sequence[Step]:
        """Stop and stay."""

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Follow a velocity and degrees per second clockwise; stop after *lasting*, or at any other step."""

    def heading(self, degrees: float) -> Sequence[Step]:
        """Turn to *degrees* clockwise from north."""

    def return_home(self, within: Ns) -> Sequence[Step]:
        """A drone lands there, a rover stops there."""

    def land(self, within: Ns) -> Sequence[Step]:
        """Here, until disarmed."""

    def stabilize(self) -> Sequence[Step]:
        """The sticks command attitude and throttle."""

    def altitude_hold(self) -> Sequence[Step]:
        """The sticks command attitude and climb rate."""

    def manual(self) -> Sequence[Step]:
        """The sticks command a rover's wheels."""

    def sticks(self, sticks: ManualControl | None) -> None:
        """Keep sending these until others come; ``None`` lets go of them."""

    def upload(self, mission: Sequence[MissionItem]) -> Sequence[Step]:
        """Replace the mission on board."""

    def start_mission(self, within: Ns) -> Sequence[Step]:
        """From its first item to its end, arming included."""

    def stop(self) -> None:
        """Let go of sticks and of set-points that are being repeated."""

    def if_silent(self) -> str:
        """In one line, from the aircraft's own parameters: what it will do if its commander falls silent.

        Empty until they are known.
        """

    def problem(self) -> LinkError | CapabilityError | None:
        """What is wrong with the way to the autopilot, or why it cannot be flown; ready to be raised."""

    def close(self) -> None:
        """Stop talking and let go of the link."""


Opener = Callable[[Kernel, Any, str, Mapping[str, str]], Driver]
"""``open_driver(kernel, channel, name, options)``: *channel* is a link, or the node for a driver that rides
on a graph; *options* are those of the address. Raises ``UsageError`` for options it does not know.
"""


@dataclass(frozen=True, kw_only=True)
class DriverFactory:
    """How a driver is opened: on a link, whose frames *codec* turns into bytes; on a node of a graph; or on
    either. ``None``: not on that.

    ``namespace`` is where on the graph its topics are if the address does not say; ``{name}`` is the
    vehicle's. ``graph_names`` says whose names they are.
    """

    on_link: Opener | None = None
    codec: Codec = MAVLINK
    on_graph: Opener | None = None
    namespace: str = "/{name}"
    graph_names: str = "mavros"


drivers: Registry[DriverFactory] = Registry("volery.drivers", "driver")
