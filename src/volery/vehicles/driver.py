"""What a driver is: telemetry that it keeps, and for each operation the steps that its autopilot needs.

A driver returns data and never waits; ``executor`` executes the steps of every driver for every vehicle.
Time-outs, refusals, restarts, takeover and fences therefore exist once, and a driver is testable without a
clock. The items of missions that an autopilot flies by itself are here, too: a driver uploads them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from math import isfinite, nan
from typing import Any, Literal, NamedTuple, Protocol, get_args

from volery.base.errors import CapabilityError, LinkError, LinkGarbled, LinkSilent, NotArrived, VehicleError
from volery.base.installed import Registry
from volery.base.position import Position
from volery.base.time import Ns
from volery.kernel.api import Action, Kernel
from volery.links.link import Link, ReceiveStatistics, WireFormat
from volery.links.mavlink_codec import MAVLINK
from volery.vehicles.services import Services
from volery.vehicles.telemetry import Telemetry, Velocity


@dataclass(frozen=True)
class TakeOff:
    """Climb to ``height`` metres above home."""

    height: float


@dataclass(frozen=True)
class Waypoint:
    """Fly to a position and stay there.

    Args:
        position: where to fly.
        stay_s: time to stay, s.
        heading: heading in degrees clockwise from north; NaN means any.
    """

    position: Position
    stay_s: float = 0.0
    heading: float = nan


@dataclass(frozen=True)
class ChangeSpeed:
    """Fly at ``speed`` m/s over ground from this item on."""

    speed: float


@dataclass(frozen=True)
class Land:
    """Land at ``position``, or in place if there is none."""

    position: Position | None = None


@dataclass(frozen=True)
class ReturnHome:
    """Return home and land."""


MissionItem = TakeOff | Waypoint | ChangeSpeed | Land | ReturnHome


def item_problem(item: MissionItem) -> str:
    """Return which number of *item* is out of range, and the remedy; empty if all are valid."""
    if isinstance(item, ChangeSpeed) and not (isfinite(item.speed) and item.speed > 0):
        return f"a speed of {item.speed:g} m/s; give one above 0"
    if isinstance(item, TakeOff) and not (isfinite(item.height) and item.height > 0):
        return f"a height of {item.height:g} m; give one above 0"
    if isinstance(item, Waypoint) and not (isfinite(item.stay_s) and item.stay_s >= 0):
        return f"a stay of {item.stay_s:g} s; give 0 or more"
    return ""


class Capability(Enum):
    """Operations that a vehicle may support; the value completes the sentence "it can ..."."""

    TAKEOFF = "take off"
    GOTO = "go to a position"
    SPEED = "go at a stated speed"
    VELOCITY = "follow a velocity"
    ACCELERATION = "follow an acceleration"
    ATTITUDE = "follow an attitude"
    HEADING = "turn to a heading"
    RETURN_HOME = "return home"
    LAND = "land"
    HOLD = "hold its place"
    MANUAL_CONTROL = "be flown by manual control"
    STABILIZE = "fly stabilized"
    ALTITUDE_HOLD = "hold its altitude"
    CLIMB_BY_THROTTLE = "climb and sink by the throttle while it holds its altitude"
    MISSION = "fly an uploaded mission"
    TERRAIN = "keep an altitude above ground"


class Repeat(NamedTuple):
    """An action that is repeated each ``period``."""

    period: Ns
    action: Action


def _never() -> str:
    return ""


@dataclass(frozen=True, kw_only=True)
class Step:
    """One command to an autopilot, and how telemetry shows that it is done.

    The functions never block, unless the driver has a cycle.

    Args:
        ask: the command in words, completing "the autopilot refused to ...".
        send: sends the command.
        done: whether telemetry shows the effect.
        within: time-out, ns.
        skippable: do not send if it is done already.
        answer: key of the acknowledgement that counts (``Telemetry.answers``).
        again: period at which the command is repeated until the acknowledgement, or until done without one.
        enters: mode that the step commands.
        mode: mode in which the vehicle must stay meanwhile.
        leads_to: modes that the autopilot may enter by itself meanwhile.
        armed: whether it must stay armed.
        lost: returns how another station has changed the target, where the mode does not show it; else empty.
        fails: returns why the step can no longer be done, which ends it at once; else empty.
        failure: error that is raised then.
        keep: repeated until the step ends.
        advice: remedy if the step is refused or late, or a function that returns it then.
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
    fails: Callable[[], str] = _never
    failure: type[VehicleError] = NotArrived
    keep: Repeat | None = None
    advice: str | Callable[[], str] = ""


class ManualControl(NamedTuple):
    """Positions of the four sticks.

    Pitch (forward positive), roll (right positive) and yaw (clockwise positive) are in -1..1, throttle in
    0..1, where 0.5 keeps the altitude in altitude hold. For a rover roll is the steering and throttle is in
    -1..1.
    """

    pitch: float = 0.0
    roll: float = 0.0
    throttle: float = 0.5
    yaw: float = 0.0


class AttitudeTarget(NamedTuple):
    """An attitude to follow.

    Roll (right positive) and pitch (nose up positive) are in degrees; thrust is in 0..1 and about 0.5 in
    hover. The heading is in degrees clockwise from north; where it is NaN the vehicle turns at ``yaw_rate``,
    degrees/s clockwise.
    """

    roll: float
    pitch: float
    thrust: float = 0.5
    heading: float = nan
    yaw_rate: float = 0.0


class Acceleration(NamedTuple):
    """Acceleration over ground, m/s²."""

    north: float
    east: float
    up: float


LinkLossAction = Literal["return", "land", "hover"]
"""What an autopilot does by itself when this program is gone."""
LINK_LOSS_ACTIONS: tuple[LinkLossAction, ...] = get_args(LinkLossAction)

Settings = Mapping[str, Callable[[float], float]]
"""New values of parameters from the present ones, by name; a function raises if this value rules it out."""


def _absent(name: str, capability: Capability) -> CapabilityError:
    return CapabilityError(f"{name} cannot {capability.value}: its driver has no steps for it")


class SetpointDriver(Protocol):
    """The part of a driver that streams set-points and manual control.

    Each is called with its capability only; a driver without it inherits what stands here.
    """

    name: str

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Follow a velocity and *yaw_rate* (degrees/s, clockwise) for *lasting* or until another step."""
        raise _absent(self.name, Capability.VELOCITY)

    def acceleration(self, acceleration: Acceleration, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Follow an acceleration and *yaw_rate*, as ``velocity``."""
        raise _absent(self.name, Capability.ACCELERATION)

    def attitude(self, target: AttitudeTarget, lasting: Ns) -> Sequence[Step]:
        """Follow an attitude and thrust for *lasting* or until another step, then stop."""
        raise _absent(self.name, Capability.ATTITUDE)

    def heading(self, degrees: float) -> Sequence[Step]:
        """Turn to *degrees* clockwise from north."""
        raise _absent(self.name, Capability.HEADING)

    def stabilize(self) -> Sequence[Step]:
        """Enter the mode in which manual control commands attitude and throttle."""
        raise _absent(self.name, Capability.STABILIZE)

    def altitude_hold(self) -> Sequence[Step]:
        """Enter the mode in which manual control commands attitude and climb rate."""
        raise _absent(self.name, Capability.ALTITUDE_HOLD)

    def manual(self) -> Sequence[Step]:
        """Enter the mode in which manual control commands the wheels of a rover."""
        raise _absent(self.name, Capability.MANUAL_CONTROL)

    def hand_over(self) -> Sequence[Step]:
        """Stop all set-points and manual control, so that the pilot's transmitter flies the vehicle."""
        raise _absent(self.name, Capability.MANUAL_CONTROL)

    def manual_control(self, control: ManualControl | None) -> None:
        """Repeat *control* until the next call; ``None`` ends the repetition."""
        if control is not None:
            raise _absent(self.name, Capability.MANUAL_CONTROL)


class ServicesDriver(Protocol):
    """What a driver offers beside flying: files, parameters and missions on board, requests, a lost link.

    A driver without one of these inherits what stands here.
    """

    name: str

    @property
    def services(self) -> Services | None:
        """Services beside flying; ``None`` if the protocol or the link carries none."""
        return None

    def request_attitude(self) -> None:
        """Receive roll and pitch from now on, where these are not received anyway; it may wait for them."""
        return

    def request_obstacles(self) -> None:
        """Receive what range sensors measure from now on, where the protocol carries it."""
        return

    def upload(self, mission: Sequence[MissionItem]) -> Sequence[Step]:
        """Replace the mission on board."""
        raise _absent(self.name, Capability.MISSION)

    def start_mission(self, within: Ns) -> Sequence[Step]:
        """Arm, start the uploaded mission; done when its last item has finished."""
        raise _absent(self.name, Capability.MISSION)

    def on_link_loss(self) -> str:
        """Return the reaction to a lost link in one line; empty until the parameters are known."""
        return "its driver does not know"

    def link_loss_settings(self, action: LinkLossAction) -> Settings:
        """Return the parameters with which the autopilot does *action* when the link is lost.

        None where it does so anyway. Raises ``CapabilityError`` where it cannot be asked for that.
        """
        raise CapabilityError(f"{self.name}: its driver cannot make it {action} when the link is lost")


class Driver(SetpointDriver, ServicesDriver, Protocol):
    """Commands one autopilot. Each operation returns the steps to execute, in order.

    What has no body here every driver has: ``examples/driver`` is one of no more than that.

    Attributes:
        name: name of the vehicle.
        telemetry: last reported state.
        landing_modes: modes in which a drone is landing or returning by itself.
    """

    telemetry: Telemetry
    landing_modes: frozenset[str] = frozenset()

    @property
    def offboard_mode(self) -> str:
        """Mode in which the autopilot obeys a computer; a pilot hands over by selecting it."""

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Operations that this vehicle supports; empty before the first message."""

    @property
    def cycle(self) -> Action | None:
        """One round of the node's loop, for drivers on a graph; ``None`` if messages arrive by themselves.

        A round processes received messages and sleeps for the period of the loop. A task that waits runs the
        rounds itself, so that their execution time is charged to it.
        """
        return None

    def poll(self) -> None:
        """Process received messages without waiting."""
        return

    def ready(self, within: Ns) -> Sequence[Step]:
        """Wait until the vehicle could arm and go to a position."""

    def arm(self) -> Sequence[Step]:
        """Arm in the present mode."""

    def disarm(self, force: bool) -> Sequence[Step]:
        """Disarm; *force* stops the motors in the air, too."""

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Take off to *height* metres above home, starting disarmed on the ground."""

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """Go to *goal* (AMSL, above home or, with ``Capability.TERRAIN``, above ground) at *speed* m/s."""

    def hold(self) -> Sequence[Step]:
        """Stop and hold the position."""

    def return_home(self, within: Ns) -> Sequence[Step]:
        """Return home; a drone lands there, a rover stops there."""

    def land(self, within: Ns) -> Sequence[Step]:
        """Land in place; done when disarmed."""

    def stop(self) -> None:
        """Stop repeating manual control and set-points."""

    def problem(self) -> LinkError | CapabilityError | None:
        """Return what is wrong with the link, or why the vehicle is not supported, as an error to raise."""

    def close(self) -> None:
        """Stop all communication and release the link."""


Opener = Callable[[Kernel, Any, str, Mapping[str, str]], Driver]
"""``open_driver(kernel, channel, name, options)``: *channel* is a link, or a node for a driver on a graph;
*options* are those of the address. Raises ``UsageError`` for unknown options.
"""


@dataclass(frozen=True, kw_only=True)
class DriverFactory:
    """How a driver is opened on a link, on a graph, or on either.

    Args:
        on_link: opener on a link; ``None`` if not supported.
        codec: codec of the link's frames.
        on_graph: opener on a node of a graph; ``None`` if not supported.
        on_ros2: opener on a node of real ROS 2 under the autopilot's own names; ``None`` if it has none.
        namespace: default namespace of its topics; ``{name}`` is replaced by the vehicle's name.
        graph_names: whose topic names it uses.
        home_option: option that states the altitude of home, m AMSL, for an autopilot that does not know it.
    """

    on_link: Opener | None = None
    codec: WireFormat = MAVLINK
    on_graph: Opener | None = None
    on_ros2: Opener | None = None
    namespace: str = "/{name}"
    graph_names: str = "mavros"
    home_option: str = ""

    def home_options(self, home: Position | None) -> dict[str, str]:
        """Return the options that state *home* (AMSL) to this driver; none where it needs none."""
        if home is None or not self.home_option:
            return {}
        return {self.home_option: f"{home.altitude.metres:g}"}


def link_error(link: Link, wrong: str) -> LinkError:
    """Return the error for a link: garbled if bytes arrived without a single frame, else silent."""
    statistics = getattr(link, "statistics", None)
    garbled = isinstance(statistics, ReceiveStatistics) and statistics.octets > 0 and not statistics.frames
    return LinkGarbled(wrong) if garbled else LinkSilent(wrong)


drivers: Registry[DriverFactory] = Registry("volery.drivers", "driver")
