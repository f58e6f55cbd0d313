"""What a mode is: a number and a name on the wire, and a manoeuvre that flies it.

A vehicle as its autopilot's software knows it: mode, arming, home, sticks, parameters, mission, failsafes.

The one state that all parts of the flight stack share. It speaks through an ``VehicleOutput`` and knows no
protocol; what differs between firmwares it asks its dialect.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot
from typing import Any, NamedTuple

from volery.base.frames import Vector
from volery.base.time import Ns, S, from_seconds
from volery.kernel.api import Action, Kernel
from volery.simulation.autopilots.autopilot_parameters import Parameter, Parameters, Tuning
from volery.simulation.autopilots.endpoint import VehicleOutput
from volery.simulation.autopilots.flight_stack.flight import Control, Estimate, Flight, Setpoint
from volery.simulation.autopilots.manual_control import NEVER, RcChannels
from volery.simulation.autopilots.onboard_mission import GLOBAL, GLOBAL_INT, OnboardMission


class Manoeuvre:
    """One way of flying. ``enter`` once, then ``step`` at every tick and whenever the sticks moved.

    While the vehicle stands on the ground with its motors off or idling, the manoeuvre says whether it
    wants to lift off (``wants_to_fly``); until the motors are up it gives no set-points that would lift it.
    """

    landing: bool = False
    """Whether it is on its way down to the ground."""

    taking_off: bool = False
    """Whether it is climbing away from the ground to a stated height."""

    slow_start: bool = False
    """Whether the motors come up slowly."""

    target: Vector | None = None
    """Where it goes: north, east, down about the estimator's origin [m]; ``None`` where it has no such
    point.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle

    def enter(self) -> None:
        """It begins now."""

    def step(self) -> None:
        """Look, decide, drive."""
        raise NotImplementedError

    def on_ground(self) -> None:
        """Called at every tick while it stands on the ground with its motors running."""

    def item_chosen(self) -> None:
        """Another mission item has become current."""

    def wants_to_fly(self) -> bool:
        """Whether the motors should come up from idle while it stands on the ground."""
        return False

    def distance(self) -> float:
        """Metres to the target in the plane; 0 without a target."""
        if self.target is None:
            return 0.0
        here = self.vehicle.estimate.position
        return hypot(self.target[0] - here[0], self.target[1] - here[1])

    def drive(self, setpoint: Setpoint) -> None:
        """Hand a set-point to the inner loops, unless they hold the same one already."""
        self.vehicle.drive(setpoint)

    def idle(self) -> None:
        """Motors turn slowly, nothing is held."""
        self.vehicle.drive(IDLE)


OFF = Setpoint(Control.OFF)
IDLE = Setpoint(Control.IDLE)


@dataclass(frozen=True)
class Mode:
    """One mode of a firmware.

    ``base_mode`` holds the heartbeat's bits while disarmed. ``controls`` are the bits of SYS_STATUS that
    are enabled and healthy in this mode only. ``pilot`` says that the sticks fly it, ``manual_throttle``
    that they command thrust. ``user_takeoff`` says that a take-off command is accepted.
    """

    number: int
    name: str
    base_mode: int
    manoeuvre: Callable[[Vehicle], Manoeuvre]
    controls: int = 0
    needs_position: bool = False
    armable: bool = True
    pilot: bool = False
    manual_throttle: bool = False
    user_takeoff: bool = False
    starts_high: bool = False
    """May be armed by a ground station with the throttle stick up."""


def do_nothing(_vehicle: Vehicle) -> None:
    """Do nothing: the default of a firmware's actions."""


class StartupTimes(NamedTuple):
    """Uptimes [ns] from which parts of the autopilot work."""

    ready_after: Ns
    """Telemetry streams run, and status texts follow the acknowledgement that they belong to."""
    origin_after: Ns
    """The estimator has an origin and the vehicle a home position."""
    position_after: Ns
    """Modes that need a position may fly."""
    local_position_after: Ns
    """The local position is sent."""
    warm_age: Ns = 60 * S
    """Uptime of a vehicle that starts warm."""


class ArmingTimes(NamedTuple):
    """Times [ns] from arming until a vehicle that flies leaves the ground; all 0 for a rover."""

    motors_rest: Ns = 0
    """After arming the motors stay off for that time."""
    spool_up: Ns = 0
    """Time from idle to full speed."""
    takeoff_slew: Ns = 0
    """Additional ramp of a slow start."""
    abandoned_after: Ns = 0
    """A vehicle on the ground that no longer wants to fly counts as landed after that time."""


class ParameterTable(NamedTuple):
    """The parameters of a firmware and what follows from them."""

    defaults: Callable[[], tuple[Parameter, ...]]
    tuning: Callable[[Parameters], Tuning]
    """Derive the limits and gains of the manoeuvres from parameter values."""
    of_vehicle: Callable[[int, Flight], Mapping[str, float]]
    """Return the values that follow from the system id and the body."""
    supported: Mapping[str, str]
    """The parameters that change the behaviour, and what each changes. All others are only stored."""


class RcDefaults(NamedTuple):
    """The simulated transmitter: its pulse widths [us] by channel, and where its throttle stick rests."""

    transmitter: Sequence[int]
    throttle_centred: bool = False


@dataclass(frozen=True, kw_only=True)
class VehicleRules:
    """What a vehicle uses of its firmware."""

    modes: Mapping[int, Mode]
    boot_mode: Mode
    startup: StartupTimes
    arming: ArmingTimes = field(default_factory=ArmingTimes)
    parameters: ParameterTable
    rc: RcDefaults
    firmware_state: Callable[[Vehicle], object] = do_nothing
    """Create the state that only this firmware keeps about a vehicle: ``Vehicle.firmware_state``."""


class Home(NamedTuple):
    """Degrees and metres AMSL, and the same point north, east, down about the estimator's origin."""

    latitude: float
    longitude: float
    amsl: float
    ned: Vector


class Vehicle:
    """The shared state. Its parts change it through its methods."""

    def __init__(
        self,
        kernel: Kernel,
        flight: Flight,
        rules: VehicleRules,
        *,
        system: int,
        name: str,
        overrides: Mapping[str, float] | None,
    ) -> None:
        self.kernel = kernel
        self.flight = flight
        self.rules = rules
        self.system = system
        self.name = name
        self.outlet: VehicleOutput
        self.restart: Action
        """Switch the autopilot off and on again."""
        self.parameters = Parameters(
            rules.parameters.defaults(), {**rules.parameters.of_vehicle(system, flight), **(overrides or {})}
        )
        self.tuning = rules.parameters.tuning(self.parameters)
        self.sticks = RcChannels(rules.rc.transmitter)
        self.plan = OnboardMission()
        self.firmware_state: Any = rules.firmware_state(self)
        """What only its firmware knows of."""
        self.boot_at: Ns = kernel.now()
        self.mode: Mode = rules.boot_mode
        self.manoeuvre: Manoeuvre = self.mode.manoeuvre(self)
        self._reset()

    def _reset(self) -> None:
        self.armed = False
        self.armed_at: Ns = NEVER
        self.disarmed_at: Ns = NEVER
        self.refused_at: Ns = NEVER
        """When arming was last refused."""
        self.landed = False
        self.landed_at: Ns = NEVER
        self.idle_since: Ns = NEVER
        self.home: Home | None = None
        self.home_by_user = False
        self.prearm_ok = False
        self.failsafes: set[str] = set()
        self.station_seen: Ns = NEVER
        """When the ground station that counts was last heard."""
        self._wanted_at: Ns = NEVER
        self._lifted = False
        self._resigned_at: Ns = NEVER
        self.speed: float | None = None
        """Speed in the plane that was commanded [m/s]; ``None``: the parameters'. Likewise up and down."""
        self.speed_up: float | None = None
        self.speed_down: float | None = None
        self.yaw_target: float | None = None
        """Heading that was commanded [rad]; ``None``: the mode's own."""
        self.flight_time: Ns = 0
        self.said: set[str] = set()
        """Words that are said once after a boot."""
        self.displayed_at: Ns = self.uptime()
        """Uptime at which it was last said why it cannot be armed."""
        self.counted_at: Ns = self.uptime()
        """Uptime at which the counters of hours were last stored."""
        self.sagging: dict[str, Ns] = {}
        """Since when the battery has been below a voltage, by the parameter that holds it."""
        self.contacts = 0
        """How often it has hit the ground."""
        self._setpoint: Setpoint = OFF
        self.flight.drive(OFF)

    # -- time and place

    def uptime(self) -> Ns:
        """Nanoseconds since boot."""
        return self.kernel.now() - self.boot_at

    @property
    def flies(self) -> bool:
        """Whether the vehicle leaves the ground (multirotor), so that standing on the ground is a state."""
        return self.flight.flying

    def boot(self, age: Ns) -> None:
        """Start anew, as if switched on *age* ago.

        The mission and the parameters stay, as in memory that keeps.
        """
        self.boot_at = self.kernel.now() - age
        self._reset()
        self.sticks.release()
        self.mode = self.rules.boot_mode
        self.manoeuvre = self.mode.manoeuvre(self)

    @property
    def estimate(self) -> Estimate:
        """What the estimator believes now."""
        return self.flight.estimate()

    @property
    def has_position(self) -> bool:
        """Whether modes that need a position may fly."""
        return self.uptime() >= self.rules.startup.position_after and self.estimate.position_ok

    def set_home(self, latitude: float, longitude: float, amsl: float) -> None:
        """From now on home is there. It lies as far below the origin as it lies lower, however far away."""
        north, east, _ = self.flight.to_ned(latitude, longitude, amsl)
        self.home = Home(latitude, longitude, amsl, (north, east, self.estimate.origin[2] - amsl))
        self.outlet.home_changed()

    def home_is_here(self) -> None:
        """Home is where the vehicle is."""
        self.set_home(*self.estimate.geodetic)

    def point(self, frame: int, latitude: float, longitude: float, altitude: float) -> Vector:
        """A point of a MAVLink frame as north, east, down about the estimator's origin.

        Altitudes above terrain are taken as above home: there is no terrain on board.
        """
        above_sea = frame in (GLOBAL, GLOBAL_INT)
        amsl = altitude if above_sea or self.home is None else self.home.amsl + altitude
        return self.flight.to_ned(latitude, longitude, amsl)

    @property
    def height(self) -> float:
        """Metres above home; above the estimator's origin while there is no home."""
        down = self.estimate.position[2]
        return (self.home.ned[2] if self.home else 0.0) - down

    # -- words

    def say(self, severity: int, text: str) -> None:
        """Words for people; severity as in syslog."""
        self.outlet.say(severity, text)

    def set_parameter(self, name: str, value: float) -> bool:
        """Set it and tell everyone; False if it cannot be."""
        changed = self.parameters.set(name, value)
        if changed is None:
            return False
        self.tuning = self.rules.parameters.tuning(self.parameters)
        self.outlet.parameter(name)
        return True

    # -- modes

    def enter(self, mode: Mode) -> None:
        """Fly *mode* from now on. Whether it may was decided before."""
        self.mode = mode
        self.speed = self.speed_up = self.speed_down = None
        self.yaw_target = None
        self.manoeuvre = mode.manoeuvre(self)
        self.manoeuvre.enter()
        if self.armed:
            self.act()
        self.outlet.mode_changed()

    def choose_item(self, index: int) -> bool:
        """Fly that mission item next."""
        chosen = self.plan.choose(index)
        if chosen:
            self.manoeuvre.item_chosen()
        return chosen

    # -- arming

    def arm(self) -> None:
        """Arm. Whether it may was decided before."""
        self.armed = True
        self.armed_at = self.idle_since = self.kernel.now()
        self._wanted_at = NEVER
        self.manoeuvre.enter()

    def disarm(self) -> None:
        """Disarm and stop the motors, wherever it is."""
        self.armed = False
        self.disarmed_at = self.kernel.now()
        self.drive(OFF)

    # -- motors

    def drive(self, setpoint: Setpoint) -> None:
        """Hand a set-point to the inner loops, unless they hold the same one already."""
        if setpoint != self._setpoint:
            self._setpoint = setpoint
            self.flight.drive(setpoint)

    @property
    def setpoint(self) -> Setpoint:
        """What the inner loops hold."""
        return self._setpoint

    def act(self) -> None:
        """Let the manoeuvre decide what the motors do; called at every tick and when the sticks moved."""
        if not self.armed:
            self.drive(OFF)
        elif self.flies and self.landed:
            self._stand()
        elif self.flies and not self._lifted and not self.manoeuvre.wants_to_fly():
            self.drive(IDLE)  # the wish to fly went before it had left the ground
        else:
            self.manoeuvre.step()

    def _stand(self) -> None:
        """On the ground: motors rest, idle, and come up in the firmware's own time when the manoeuvre wants
        to fly.
        """
        now, times = self.kernel.now(), self.rules.arming
        if now - self.armed_at < times.motors_rest:
            self.drive(OFF)
            return
        self.manoeuvre.on_ground()
        if not self.armed:
            return
        if not self.manoeuvre.wants_to_fly():
            self._wanted_at = NEVER
            self.drive(IDLE)
            return
        if self._wanted_at == NEVER:
            self._wanted_at = now
        ready = self._wanted_at
        if self.manoeuvre.slow_start:
            idling = self.armed_at + times.motors_rest + times.spool_up
            ready = max(ready, idling) + times.takeoff_slew
        if now < ready:
            self.drive(IDLE)
            return
        self.landed = self._lifted = False
        self._resigned_at = now
        self.manoeuvre.step()

    def watch_ground(self) -> None:
        """Notice that it has left the ground, come down, or given up the wish to fly."""
        if not self.armed or self.landed or not self.flies:
            return
        now = self.kernel.now()
        on_ground = self.estimate.landed
        self._lifted = self._lifted or not on_ground
        if not on_ground or self.manoeuvre.wants_to_fly():
            self._resigned_at = now
        if on_ground and (self._lifted or now - self._resigned_at >= self.rules.arming.abandoned_after):
            self.landed = True
            self.landed_at = self.idle_since = now
            self._wanted_at = NEVER

    def seconds_parameter(self, name: str) -> Ns:
        """A parameter in seconds as nanoseconds."""
        return from_seconds(self.parameters[name])


VehicleAction = Callable[[Vehicle], None]
"""An action of a firmware on its vehicle."""
