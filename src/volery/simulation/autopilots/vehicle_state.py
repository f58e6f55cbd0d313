"""Modes, manoeuvres and the state of one simulated vehicle as its autopilot software keeps it.

The three stand in one module because they need one another: a mode creates its manoeuvre, a manoeuvre reads
and drives its vehicle, a vehicle runs its manoeuvre. All parts of an autopilot share the
``AutopilotVehicle``. It sends through a ``VehicleOutput`` and knows no protocol; what differs between
firmwares it reads from its ``VehicleRules``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.base.frames import Vector
from volery.base.time import Ns, S, from_seconds
from volery.kernel.api import Action, Kernel
from volery.simulation.autopilots.autopilot_parameters import (
    NOT_RENAMED,
    ManoeuvreTuning,
    Renamed,
    StoredParameter,
    VehicleParameters,
)
from volery.simulation.autopilots.flight_stack.flight import Control, Estimate, Flight, Setpoint
from volery.simulation.autopilots.manual_control import ReceivedChannels
from volery.simulation.autopilots.onboard_log import FlightLog, LogRow
from volery.simulation.autopilots.onboard_mission import GLOBAL, GLOBAL_INT, MissionItem, OnboardMission
from volery.simulation.autopilots.protocol_endpoint import VehicleOutput
from volery.simulation.autopilots.state_groups import (
    NEVER,
    ArmingState,
    CommandedLimits,
    FailsafeState,
    GroundState,
    Home,
    ReportState,
)


class FlightManoeuvre:
    """One way of flying or driving.

    ``enter`` is called once, then ``step`` at every tick and when the RC channels move. While the vehicle
    stands on the ground with its motors off or idling, ``takeoff_requested`` decides whether they come up;
    until then the manoeuvre is not stepped.

    Args:
        vehicle: The vehicle that is flown.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        self.vehicle = vehicle
        self.landing = False
        """Whether it descends to land."""
        self.taking_off = False
        """Whether it climbs from the ground to a commanded height."""
        self.starts_at_once = False
        """Whether the motors may come up as soon as the vehicle is armed."""
        self.waiting = IDLE
        """Set-point of an armed vehicle on the ground until it takes off."""
        self.slow_start = False
        """Whether the motors come up slowly."""
        self.target: Vector | None = None
        """Its destination, north, east, down about the estimator's origin [m]; ``None``: it has none."""

    @property
    def flown(self) -> FlightManoeuvre:
        """The manoeuvre that gives the set-points: this one, or the part of it that is flown now."""
        return self

    def enter(self) -> None:
        """Begin the manoeuvre."""

    def step(self) -> None:
        """Read the estimate and give a set-point."""
        raise NotImplementedError

    def on_ground(self) -> None:
        """Do what is due at a tick while the vehicle stands on the ground with its motors running."""

    def item_chosen(self) -> None:
        """Take over that another mission item has become current."""

    def takeoff_requested(self) -> bool:
        """Return whether the motors should come up from idle on the ground."""
        return False

    def pause(self) -> bool:
        """Stop where the vehicle is until ``resume``; return False where that is not possible."""
        return False

    def resume(self) -> bool:
        """Continue after a pause; return False where there is nothing to continue."""
        return False

    def distance(self) -> float:
        """Return the horizontal distance to the target [m]; 0 without a target."""
        if self.target is None:
            return 0.0
        here = self.vehicle.estimate.position
        return hypot(self.target[0] - here[0], self.target[1] - here[1])


FIX_3D = 3
"""GPS_FIX_TYPE."""
OFF = Setpoint(Control.OFF)
IDLE = Setpoint(Control.IDLE)


@dataclass(frozen=True)
class Mode:
    """One mode of a firmware.

    Args:
        number: Number on the wire.
        name: Name in texts and traces.
        base_mode: MAV_MODE_FLAG bits of the heartbeat while disarmed.
        manoeuvre: Creates the manoeuvre that flies the mode.
        controls: Bits of SYS_STATUS that are enabled and healthy in this mode only.
        needs_position: Whether the mode needs a position estimate.
        armable: Whether the vehicle may be armed in it.
        pilot: Whether the RC channels fly it.
        manual_throttle: Whether the throttle channel commands thrust.
        user_takeoff: Whether a take-off command is accepted.
        starts_high: Whether a ground station may arm with the throttle channel up.
    """

    number: int
    name: str
    base_mode: int
    manoeuvre: Callable[[AutopilotVehicle], FlightManoeuvre]
    controls: int = 0
    needs_position: bool = False
    armable: bool = True
    pilot: bool = False
    manual_throttle: bool = False
    user_takeoff: bool = False
    starts_high: bool = False


def do_nothing(_vehicle: AutopilotVehicle) -> None:
    """Do nothing: the default of a firmware's actions."""


def unlimited(_vehicle: AutopilotVehicle, setpoint: Setpoint) -> Setpoint:
    """Return *setpoint*: the default of a firmware without avoidance."""
    return setpoint


def height_above_home(vehicle: AutopilotVehicle) -> float:
    """Return the height above home: the default of a firmware without a range finder."""
    return vehicle.height


def senses_ground(vehicle: AutopilotVehicle) -> bool:
    """Return what the flight stack's landed detector reports: the default of a firmware."""
    return vehicle.estimate.landed


def no_rows(_vehicle: AutopilotVehicle) -> tuple[LogRow, ...]:
    """Return no rows: the default of a firmware that logs nothing of its own."""
    return ()


def no_remedy(_parameter: str) -> str:
    """Return an empty text: the default of a firmware that always has the same parameters."""
    return ""


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
    """A vehicle on the ground without a request to take off counts as landed after that time."""
    landed_after: Ns = 0
    """A vehicle that touches the ground counts as landed that long after the landed detector's report."""


class ParameterTable(NamedTuple):
    """The parameters of a firmware and what follows from them."""

    defaults: Callable[[], tuple[StoredParameter, ...]]
    tuning: Callable[[VehicleParameters], ManoeuvreTuning]
    """Derive the limits and gains of the manoeuvres from parameter values."""
    of_vehicle: Callable[[int, Flight], Mapping[str, float]]
    """Return the values that follow from the system id and the body."""
    supported: Mapping[str, str]
    """The parameters that change the behaviour, and what each changes. No other can be changed."""
    renamed: Mapping[str, Renamed] = NOT_RENAMED
    """Parameters that this version shows otherwise."""
    remedy: Callable[[str], str] = no_remedy
    """Return what to do to have a parameter that is not there; empty: nothing."""


class RcDefaults(NamedTuple):
    """The simulated transmitter: its pulse widths [us] by channel, and where its throttle stick rests."""

    transmitter: Sequence[int]
    throttle_centred: bool = False
    can_be_lost: bool = False
    """Whether the firmware reacts to its loss."""


@dataclass(frozen=True, kw_only=True)
class VehicleRules:
    """What a vehicle uses of its firmware."""

    modes: Mapping[int, Mode]
    boot_mode: Mode
    startup: StartupTimes
    arming: ArmingTimes = field(default_factory=ArmingTimes)
    parameters: ParameterTable
    rc: RcDefaults
    senses_ground: Callable[[AutopilotVehicle], bool] = senses_ground
    """Return whether the landed detector of a vehicle in flight reports the ground."""
    position_kept: float = 10.0
    """Time for which a position counts after the receiver has lost its fix [s]."""
    pose_kept: float = 7.0
    """Time for which it counts after the last external pose [s]; by default posRetryTimeNoVel_ms of EKF3."""
    return_point: Callable[[AutopilotVehicle], Vector | None] = do_nothing
    """Return where a return ends and its least height, north, east, down [m]; ``None``: home."""
    height_above_ground: Callable[[AutopilotVehicle], float] = height_above_home
    """Return the height that a landing goes by [m]."""
    limit: Callable[[AutopilotVehicle, Setpoint], Setpoint] = unlimited
    """Return the set-point that a manoeuvre may give, as avoidance limits it."""
    log_extras: Callable[[AutopilotVehicle], tuple[LogRow, ...]] = no_rows
    """Return what the log on board records beside the samples of every firmware."""
    firmware_state: Callable[[AutopilotVehicle], object] = do_nothing
    """Create the state that only this firmware keeps about a vehicle: ``AutopilotVehicle.firmware_state``."""


class AutopilotVehicle:
    """State of one simulated vehicle as its autopilot software keeps it, shared by all its parts.

    The state is grouped by owner: ``arming``, ``ground``, ``commanded``, ``failsafes``, ``reports``, ``rc``,
    ``mission``, ``parameters`` and the home position. All but the last three and ``rc`` are cleared by a
    boot.

    Args:
        kernel: Clock and timers.
        flight: The flight stack's handle.
        rules: What the vehicle uses of its firmware.
        system: MAVLink system id.
        name: Name of the vehicle in texts and traces.
        overrides: Parameter values that replace the firmware's.
    """

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
        self.output: VehicleOutput
        self.restart: Action
        """Restart the autopilot."""
        table = rules.parameters
        try:
            self.parameters = VehicleParameters(
                table.defaults(),
                overrides,
                table.renamed,
                of_vehicle=table.of_vehicle(system, flight),
                supported=table.supported,
                remedy=table.remedy,
            )
        except UsageError as error:
            raise UsageError(f"{name}: {error}") from None
        self.tuning = ManoeuvreTuning()
        self._tune()
        self.rc = ReceivedChannels(rules.rc.transmitter)
        self.mission = OnboardMission()
        self.points: dict[int, list[MissionItem]] = {}
        """Points of the fence and rally points, by MAV_MISSION_TYPE; they persist like the mission."""
        self.logs: list[FlightLog] = []
        """Recorded flights, oldest first; they persist, too."""
        self.firmware_state: Any = rules.firmware_state(self)
        """State that only the firmware uses."""
        self.kept: dict[Any, Any] = {}
        """State that parts of the firmware keep until the next boot, by its owner."""
        self.boot_at: Ns = kernel.now()
        self.mode: Mode = rules.boot_mode
        self.mode_before: Mode = rules.boot_mode
        """The mode that was left last."""
        self.manoeuvre: FlightManoeuvre = self.mode.manoeuvre(self)
        self._reset()

    def _reset(self) -> None:
        self.arming = ArmingState()
        self.ground = GroundState()
        self.commanded = CommandedLimits()
        self.failsafes = FailsafeState()
        self.reports = ReportState()
        self.kept.clear()
        self.home: Home | None = None
        self._setpoint: Setpoint = OFF
        self.flight.drive(OFF)

    def boot(self, age: Ns) -> None:
        """Boot, as if power had been switched on *age* [ns] ago. Mission and parameters persist."""
        self.boot_at = self.kernel.now() - age
        self._reset()
        self.rc.release()
        self._start_hover_throttle()
        self.mode = self.rules.boot_mode
        self.manoeuvre = self.mode.manoeuvre(self)

    def uptime(self) -> Ns:
        """Return the time since boot [ns]."""
        return self.kernel.now() - self.boot_at

    @property
    def flies(self) -> bool:
        """Whether the vehicle leaves the ground (multirotor), so that standing on the ground is a state."""
        return self.flight.flying

    @property
    def armed(self) -> bool:
        """Whether the motors may turn."""
        return self.arming.armed

    @property
    def landed(self) -> bool:
        """Whether the autopilot counts the vehicle as standing on the ground."""
        return self.ground.landed

    # -- position

    @property
    def estimate(self) -> Estimate:
        """The estimate now."""
        return self.flight.estimate()

    @property
    def position_ok(self) -> bool:
        """Whether the estimator has a position that counts."""
        estimate = self.estimate
        if estimate.by_poses:
            return estimate.position_ok and estimate.gps_age < self.rules.pose_kept
        fresh = estimate.gps_age < self.rules.position_kept
        return estimate.position_ok and (fresh or estimate.fix_type >= FIX_3D)

    @property
    def has_position(self) -> bool:
        """Whether modes that need a position may fly."""
        return self.uptime() >= self.rules.startup.position_after and self.position_ok

    @property
    def height(self) -> float:
        """Height above home [m]; above the estimator's origin while there is no home."""
        down = self.estimate.position[2]
        return (self.home.ned[2] if self.home else 0.0) - down

    def set_home(self, latitude: float, longitude: float, amsl: float, *, by_user: bool = False) -> None:
        """Set the home position and report it.

        Its distance below the estimator's origin is the difference of the heights AMSL, however far away.

        Args:
            latitude: Latitude [degrees].
            longitude: Longitude [degrees].
            amsl: Height above mean sea level [m].
            by_user: Whether a user sets it; remembered until the next boot.
        """
        north, east, _ = self.flight.to_ned(latitude, longitude, amsl)
        by_user = by_user or (self.home is not None and self.home.by_user)
        self.home = Home(latitude, longitude, amsl, (north, east, self.estimate.origin[2] - amsl), by_user)
        self.output.home_changed()

    def set_home_here(self, *, by_user: bool = False) -> None:
        """Set the home position to the estimated position."""
        self.set_home(*self.estimate.geodetic, by_user=by_user)

    def point(self, frame: int, latitude: float, longitude: float, altitude: float) -> Vector:
        """Convert a point in a MAVLink frame to north, east, down about the estimator's origin [m].

        Heights above terrain are taken as above home: there is no terrain map on board.

        Args:
            frame: MAV_FRAME.
            latitude: Latitude [degrees].
            longitude: Longitude [degrees].
            altitude: Height [m] above the frame's reference.
        """
        above_sea = frame in (GLOBAL, GLOBAL_INT)
        amsl = altitude if above_sea or self.home is None else self.home.amsl + altitude
        return self.flight.to_ned(latitude, longitude, amsl)

    # -- texts and parameters

    def send_text(self, severity: int, text: str) -> None:
        """Send a status text; severity as in syslog."""
        self.output.send_text(severity, text)

    def set_parameter(self, name: str, value: float) -> bool:
        """Set a parameter and report it; return False if it does not exist or does not take *value*."""
        if self.parameters.set(name, value) is None:
            return False
        self._tune()
        self.output.parameter_changed(name)
        return True

    def _tune(self) -> None:
        before = self.tuning.hover_throttle
        self.tuning = self.rules.parameters.tuning(self.parameters)
        if self.tuning.hover_throttle != before:
            self._start_hover_throttle()
        self.flight.set_yaw_loop(*self.tuning.yaw_loop)
        self.flight.set_brakes(on=self.tuning.brakes)
        self.flight.set_gps_gate(*self.tuning.gps_gate)
        self.flight.set_thrust_voltage(*self.tuning.thrust_volts)
        self.flight.set_hover_learning(on=self.tuning.learns_hover)

    def _start_hover_throttle(self) -> None:
        """Take the stored hover throttle from the parameters, where there is one."""
        if self.tuning.hover_throttle is not None:
            self.flight.set_hover_throttle(self.tuning.hover_throttle)

    def seconds_parameter(self, name: str) -> Ns:
        """Return the value of a parameter in seconds as nanoseconds."""
        return from_seconds(self.parameters[name])

    # -- modes and mission

    def enter_mode(self, mode: Mode) -> None:
        """Enter *mode*. The caller has decided that the mode is permitted."""
        self.mode_before = self.mode
        self.mode = mode
        self.commanded = CommandedLimits()
        self.manoeuvre = mode.manoeuvre(self)
        self.manoeuvre.enter()
        if self.armed:
            self.run_manoeuvre()
        self.output.mode_changed()

    def choose_item(self, index: int) -> bool:
        """Make mission item *index* the next one; return False if there is none."""
        chosen = self.mission.choose(index)
        if chosen:
            self.manoeuvre.item_chosen()
        return chosen

    # -- arming

    def arm(self) -> None:
        """Arm. The caller has decided that arming is permitted."""
        now = self.kernel.now()
        self.arming.armed = True
        self.arming.armed_at = now
        self.ground.arm(now)
        self.manoeuvre.enter()

    def disarm(self) -> None:
        """Disarm and stop the motors, also in flight."""
        self.arming.armed = False
        self.arming.disarmed_at = self.kernel.now()
        self.drive(OFF)

    # -- motors

    def drive(self, setpoint: Setpoint) -> None:
        """Pass a set-point to the inner loops within the firmware's limits."""
        self._setpoint = self.rules.limit(self, setpoint)
        self.flight.drive(self._setpoint)

    @property
    def setpoint(self) -> Setpoint:
        """Set-point in force."""
        return self._setpoint

    def run_manoeuvre(self) -> None:
        """Let the manoeuvre update the set-point; called at every tick and when the RC channels move."""
        if not self.armed or self.arming.motors_stopped_at != NEVER:
            self.drive(OFF)
        elif self.flies and self.landed:
            self._run_on_ground()
        elif self.flies and not self.ground.lifted and not self.manoeuvre.takeoff_requested():
            self.drive(IDLE)  # the request was withdrawn before the vehicle had left the ground
        else:
            self.manoeuvre.step()

    def _run_on_ground(self) -> None:
        """Stop, idle or start the motors in the firmware's own time, as the manoeuvre requests a take-off."""
        now, times, ground = self.kernel.now(), self.rules.arming, self.ground
        if now - self.arming.armed_at < times.motors_rest and not self.manoeuvre.starts_at_once:
            self.drive(OFF)
            return
        self.manoeuvre.on_ground()
        if not self.armed:
            return
        if self.arming.blocked or not self.manoeuvre.takeoff_requested():
            ground.takeoff_requested_at = NEVER
            self.drive(self.manoeuvre.waiting)
            return
        if ground.takeoff_requested_at == NEVER:
            ground.takeoff_requested_at = now
        ready = ground.takeoff_requested_at
        if self.manoeuvre.slow_start:
            idling = self.arming.armed_at + times.motors_rest + times.spool_up
            ready = max(ready, idling) + times.takeoff_slew
        if now < ready:
            self.drive(IDLE)
            return
        ground.leave(now)
        self.manoeuvre.step()

    def update_ground(self) -> None:
        """Update the ground state of a vehicle in flight; called at every tick."""
        if self.armed and not self.landed and self.flies:
            on_ground = self.rules.senses_ground(self)
            requested = on_ground and self.manoeuvre.takeoff_requested()
            times = self.rules.arming
            self.ground.update(
                self.kernel.now(), on_ground, requested, times.abandoned_after, times.landed_after
            )


VehicleAction = Callable[[AutopilotVehicle], None]
"""An action of a firmware on its vehicle."""
