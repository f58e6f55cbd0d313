"""The state of a simulated vehicle by owner: home, arming, ground, commanded limits, failsafes, reports.

``Vehicle`` holds one of each, and replaces all of them at a boot.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.base.frames import Vector
from volery.base.time import Ns

NEVER: Ns = -(1 << 62)
"""Time of an event that has not happened."""


class Home(NamedTuple):
    """Home position.

    Args:
        latitude: Latitude [degrees].
        longitude: Longitude [degrees].
        amsl: Height above mean sea level [m].
        ned: The same point north, east, down about the estimator's origin [m].
        by_user: Whether a user has set a home since boot: arming then does not move it.
    """

    latitude: float
    longitude: float
    amsl: float
    ned: Vector
    by_user: bool = False


@dataclass
class ArmingState:
    """Arming, changed by ``Vehicle.arm``, ``Vehicle.disarm`` and the firmware's checks. Times in ns."""

    armed: bool = False
    armed_at: Ns = NEVER
    disarmed_at: Ns = NEVER
    refused_at: Ns = NEVER
    """Time at which arming was last refused."""
    checks_passed: bool = False
    """Result of the last arming checks, for firmwares that check regularly."""
    blocked: bool = False
    """Whether the motors of an armed vehicle on the ground stay idle."""
    warned_at: Ns = NEVER
    """Time of the last warning of that."""


@dataclass
class GroundState:
    """Whether the vehicle stands on the ground, as its autopilot has found. Times in ns."""

    landed: bool = False
    landed_at: Ns = NEVER
    idle_since: Ns = NEVER
    """Since when an armed vehicle has stood on the ground without a request to take off."""
    flight_time: Ns = 0
    """Time in flight since boot, where the firmware counts it."""
    track: list[Vector] = field(default_factory=list)
    """Points passed since arming, north, east, down about the estimator's origin [m], where they are kept."""
    track_lost_since: Ns = NEVER
    """Since when an armed vehicle has had no position for its track."""
    track_ended: bool = False
    """Whether the track is given up until the vehicle is armed again."""
    lifted: bool = False
    """Whether the landed detector has reported flight since the motors came up."""
    takeoff_requested_at: Ns = NEVER
    takeoff_last_requested_at: Ns = NEVER
    touched_at: Ns = NEVER
    """Since when the landed detector has reported ground."""

    def arm(self, now: Ns) -> None:
        """Start to wait for a request to take off."""
        self.idle_since = now
        self.track.clear()
        self.track_lost_since, self.track_ended = NEVER, False
        self.takeoff_requested_at = NEVER

    def leave(self, now: Ns) -> None:
        """Begin a flight: the motors come up now."""
        self.landed = self.lifted = False
        self.takeoff_last_requested_at = now

    def update(
        self, now: Ns, on_ground: bool, takeoff_requested: bool, abandoned_after: Ns, landed_after: Ns = 0
    ) -> None:
        """Update the state of an armed vehicle in flight.

        It has landed once the detector has reported ground after flight for *landed_after*, or, without a
        flight, once it has stood on the ground without a request to take off for *abandoned_after*.

        Args:
            now: The time [ns].
            on_ground: Report of the landed detector.
            takeoff_requested: Whether the manoeuvre requests to take off, on the ground.
            abandoned_after: Time after which a take-off that never left the ground ends [ns].
            landed_after: Time for which the detector has to report ground [ns].
        """
        self.lifted = self.lifted or not on_ground
        if not on_ground:
            self.touched_at = NEVER
        elif self.touched_at == NEVER:
            self.touched_at = now
        if not on_ground or takeoff_requested:
            self.takeoff_last_requested_at = now
        if self.lifted:
            ended = now - self.touched_at >= landed_after
        else:
            ended = now - self.takeoff_last_requested_at >= abandoned_after
        if on_ground and ended:
            self.landed = True
            self.landed_at = self.idle_since = now
            self.takeoff_requested_at = NEVER


@dataclass
class SwitchState:
    """Switches of the transmitter, as the firmware has read them. Times in ns."""

    mode: int = 0
    """Position of the mode switch, from 1; 0: not read yet."""
    read: int = 0
    """Position that it may have moved to."""
    read_since: Ns = NEVER
    rudder_since: Ns = NEVER
    """Since when the yaw stick has been at the same end with the throttle closed."""
    rudder: int = 0
    """That end: 1 right, -1 left."""
    options: dict[int, int] = field(default_factory=dict)
    """Position of the switch by channel: 1 up, 0 in the middle, -1 down."""
    emergency_stop: bool = False
    interlock_closed: bool = False
    motors_stopped_at: Ns = NEVER
    """Since when one of the two has kept the motors from turning."""
    overrides_denied: bool = False
    """Whether a switch denies the sticks of a ground station."""
    satellites_ignored: bool = False
    """Whether the chosen set of sources of the estimator has no satellites."""
    mixed_steering: tuple[float, float] = (0.0, 0.0)
    """Steering that the pilot adds to that of the controls, and the share that these lose, as last given."""
    read_from: tuple[list[int], int] | None = None
    """Pulse widths of all channels, and changes of parameters, that all of them were last read from."""


@dataclass
class SprayerState:
    """Crop sprayer."""

    running: bool = False
    """Whether it may spray."""
    tested: bool = False
    """Whether the pump turns at rest."""
    spraying: bool = False
    changes_since: Ns = NEVER
    """Since when the speed has been where it starts or stops to spray."""


@dataclass
class WinchState:
    """Winch."""

    action: int = 0
    """WINCH_ACTIONS."""
    started: bool = False
    """Whether the first action has been taken."""
    rate: float = 0.0
    """Rate that is wanted [m/s], positive out, and the same with limited acceleration."""
    limited_rate: float = 0.0
    length: float = 0.0
    """Line that is out [m], and the length that is wanted."""
    target: float = 0.0
    by_pilot: bool = False
    pilot_pulse: int | None = None
    """Pulse width [us] of the pilot's channel when it last counted."""


@dataclass
class MountState:
    """Camera mount. Angles are roll, pitch and yaw [rad]; places are north, east, down [m]."""

    present: bool | None = None
    """Whether the vehicle has booted with a mount; ``None``: not known yet."""
    mode: int = 0
    """MAV_MOUNT_MODE."""
    angles: Vector = (0.0, 0.0, 0.0)
    """Target: roll and pitch about the horizon, yaw from the nose or from north."""
    from_north: bool = False
    rates: Vector | None = None
    """Rates at which the target turns; ``None``: it has angles only."""
    rates_from_north: bool = False
    place: Vector | None = None
    """Region of interest."""
    follows: int = 0
    """System whose positions it follows, and where that was last."""
    followed: Vector | None = None
    yaw_locked: bool = False
    """Whether the pilot's yaw counts from north."""
    pilot_pulses: list[int] = field(default_factory=lambda: [0, 0, 0])
    """Pulse widths [us] of the pilot's channels when they last counted."""
    controller: tuple[int, int] = (0, 0)
    """System and component that are in control, for others to read."""
    warned_at: Ns = NEVER


@dataclass
class CameraState:
    """Camera."""

    kind: int | None = None
    """Type that the vehicle has booted with; ``None``: not known yet."""
    pictures: int = 0
    taken_at: Ns = NEVER
    place: Vector | None = None
    """Where the last picture was taken, or the distance to the next one counts from."""
    pressed_until: Ns = NEVER
    """Until when the servo presses the trigger."""
    pending: bool = False
    """Whether a picture came too early and is taken later."""
    period: Ns = 0
    left: int = 0
    """Pictures that are still to be taken in that period; negative: without end."""
    feedback: dict[str, Any] = field(default_factory=dict)
    """Report of the last picture."""
    has_components: bool = False
    """Whether a component of the vehicle has been received that may be a camera."""


@dataclass
class MotorTestState:
    """Test of motors on the ground."""

    running: bool = False
    motor: int = 0
    """Number of the motor in the order of the test, from 1."""
    motors_left: int = 1
    """Motors that are tested yet, with this one."""
    kind: int = 0
    """MOTOR_TEST_THROTTLE_TYPE."""
    value: float = 0.0
    since: Ns = NEVER
    period: Ns = 0
    """Time for which each motor turns."""


@dataclass
class OutputState:
    """Outputs beside the motors, as commands have set them."""

    servos: dict[int, int] = field(default_factory=dict)
    """Pulse widths [us] by channel, from 1."""
    relays: set[int] = field(default_factory=set)
    """Relays that are on, from 0."""
    repeated: tuple[str, int] | None = None
    """Kind and number of the output that changes by itself."""
    repetitions: int = 0
    """Number of the last order to change an output repeatedly."""
    gripper: int | None = None
    """What the gripper has done: 0 released, 1 grabbed; ``None``: it is neutral or moves."""
    functions: dict[int, int] = field(default_factory=dict)
    """Function by channel, of the channels that have one, and the changes of parameters that it holds for."""
    functions_at: int = -1
    sprayer: SprayerState = field(default_factory=SprayerState)
    winch: WinchState = field(default_factory=WinchState)
    mount: MountState = field(default_factory=MountState)
    camera: CameraState = field(default_factory=CameraState)
    motor_test: MotorTestState = field(default_factory=MotorTestState)


@dataclass
class ButtonState:
    """Buttons on the pins of an autopilot."""

    pressed: int | None = None
    """One bit for each button whose pin is high; ``None`` until they are first read."""
    changed_at: Ns = NEVER
    changed_ms: int = 0
    """Time of the last change, and the same since boot [ms]."""
    reported_at: Ns = NEVER
    on: set[int] = field(default_factory=set)
    """Buttons whose function has last run as pressed, from 0."""


class GuidedLimits(NamedTuple):
    """Limits at which a mission takes the vehicle back from a companion computer; 0: none."""

    seconds: float = 0.0
    lowest: float = 0.0
    """Height [m] above the estimator's origin, as ``highest``."""
    highest: float = 0.0
    distance: float = 0.0
    """Horizontal distance [m] from where it was handed over."""


NO_LIMITS = GuidedLimits()


@dataclass
class LeadState:
    """Another vehicle that this one may follow, as it last reported itself."""

    system: int = 0
    """System that was chosen where none is named."""
    at: Ns = NEVER
    """Time of the report [ns]."""
    place: Vector = (0.0, 0.0, 0.0)
    """North, east, down about the estimator's origin [m], as ``velocity`` [m/s]."""
    velocity: Vector = (0.0, 0.0, 0.0)
    heading: float = 0.0
    """Clockwise from north [rad], and the time [ns] at which it was last reported."""
    heading_at: Ns = NEVER


@dataclass
class GearState:
    """Landing gear, as its outputs were last set."""

    deployed: bool | None = None
    """``None`` until it has moved."""
    started: bool = False
    """Whether the position at the start has been taken."""
    height: int = 0
    """Height above home [m], climb and landing at the last tick."""
    climbing: bool = False
    landing: bool = False


@dataclass
class VaneState:
    """Turning into the wind."""

    since: Ns = NEVER
    """Since when [ns] the conditions have held."""
    turning: bool = False
    rate: float = 0.0
    """Rate of the turn, clockwise [degrees/s]."""
    heading: float = 0.0
    """Heading that it has commanded, clockwise from north [rad], and the command before it."""
    before: float | None = None


@dataclass
class CommandedLimits:
    """Limits and heading that commands and mission items have set for the present mode; ``None``: not set."""

    speed: float | None = None
    """Horizontal speed [m/s]."""
    speed_up: float | None = None
    """Climb rate [m/s]."""
    speed_down: float | None = None
    """Descent rate [m/s]."""
    yaw: float | None = None
    """Heading, clockwise from north [rad]."""
    yaw_left: float = 0.0
    """Angle by which ``yaw`` still turns, clockwise [rad], for firmwares that turn it at a rate."""
    yaw_rate: float = 0.0
    """That rate [rad/s]."""
    look_at: Vector | None = None
    """Region of interest that the nose follows, for firmwares that turn it: north, east, down [m]."""
    guided_limits: GuidedLimits = NO_LIMITS
    backwards: bool = False
    """Whether a rover drives to points backwards."""
    vane: VaneState = field(default_factory=VaneState)

    def forget_heading(self) -> None:
        """Leave the heading to the target that is flown to."""
        self.yaw = self.look_at = None
        self.yaw_left = 0.0

    def forget_speeds(self) -> None:
        """Return to the firmware's own speeds."""
        self.speed = self.speed_up = self.speed_down = None


@dataclass
class FailsafeState:
    """Failsafes in force, and what the conditions of failsafes remember."""

    active: set[str] = field(default_factory=set)
    """Names of the failsafes whose condition is true."""
    station_last_ns: Ns = NEVER
    """Time of the last message of the ground station that controls the vehicle [ns]."""
    simulated: tuple[float, ...] = (0.0, 0.0, 1.0, 0.0, 180.0, 12.6, 0.0, 0.0)
    """Values of the parameters that inject faults, as they were last applied."""
    no_receiver_since: Ns = NEVER
    """Since when the parameters have left the autopilot without a receiver of satellites."""
    simulated_at: int = -1
    """Changes of parameters when these were last compared."""
    pushed: bool = False
    """Whether a simulated force from outside acts."""
    rc_received: bool = False
    """Whether a transmitter or overrides have been received since boot."""
    crashing_since: Ns = NEVER
    """Since when [ns] a vehicle leans far from where it should."""
    glitching: bool = False
    """Whether the estimator has refused all fixes for a second, and has not fused them for ten since then."""
    refused_at: Ns = NEVER
    """When [ns] it last refused one."""
    true_since: dict[str, Ns] = field(default_factory=dict)
    """Since when [ns] a condition has been true that must last before a failsafe acts, by its name."""


@dataclass
class ReportState:
    """What a firmware has reported since boot."""

    sent_once: set[str] = field(default_factory=set)
    """Texts that are sent once after a boot."""
    arming_checks_at: Ns = 0
    """Uptime of the last report of failed arming checks [ns]."""
    arming_checks_due: bool = False
    """Whether checks have begun to fail since then."""
    counters_at: Ns = 0
    """Uptime at which operating hours were last stored [ns]."""
    contacts: int = 0
    """Number of touch-downs reported."""
    parameters_erased: bool = False
    """Whether the parameters have their defaults from the next boot on."""
    item_reached: int | None = None
    """Number of an action that was reported instead of the waypoint before it."""
    high_latency: bool = False
    """Whether a command has switched the links of high latency on."""
    gauge_offset_mah: float = 0.0
    """Charge that the battery's gauge counts beyond what was drawn [mAh]."""


@dataclass
class FenceState:
    """Breaches of the fence."""

    floor: bool = False
    """Whether the floor counts."""
    breached: dict[int, float] = field(default_factory=dict)
    """Limits beyond which the vehicle is, to the distance beyond [m] at which the breach counts anew."""
    count: int = 0
    """Number of breaches."""
    breached_at: Ns = 0
    """Uptime of the last of them [ns]."""
    total: int = 0
    """Number of points that was stated last."""


@dataclass
class ProximityState:
    """Proximity sensor. Distances are in metres, directions eighths of a turn clockwise from the nose."""

    kind: int | None = None
    """Type that the vehicle has booted with; ``None``: not known yet."""
    range: tuple[float, float] = (0.0, 0.0)
    """Least and largest distance that the sensor states."""
    distances: dict[int, float] = field(default_factory=dict)
    """Last distance by direction."""
    filtered: dict[int, float] = field(default_factory=dict)
    """The same after the low-pass."""
    angles: dict[int, float] = field(default_factory=dict)
    """Angle of each last distance from the nose, clockwise [degrees]."""
    measured_at: dict[int, Ns] = field(default_factory=dict)
    collected: dict[int, tuple[float, float]] = field(default_factory=dict)
    """Least distance by direction and its angle, of the messages with the time stamp that came last."""
    stamp: int = -1
    received_at: Ns = NEVER
    """When a message came last."""
    upward: float = 0.0
    """Distance above the vehicle."""
    upward_at: Ns = NEVER


@dataclass
class SurfaceState:
    """The ground below by the range finder: heights above the estimator's origin [m], times in ns."""

    ignored: bool = False
    """Whether a switch keeps the range finder from being used."""
    ground: float = 0.0
    """Height of the ground, filtered, and by how much of it the target height has moved."""
    followed: float = 0.0
    measured_at: Ns = NEVER
    followed_at: Ns = NEVER


@dataclass
class PrecisionState:
    """Target of a precision landing. Lengths in metres, times in ns."""

    kind: int | None = None
    """Type that the vehicle has booted with; ``None``: not known yet."""
    found: bool = False
    """Whether the target is seen, and since when."""
    found_at: Ns = NEVER
    acquired: bool = False
    """Whether it counts."""
    measured_at: Ns = NEVER
    place: tuple[float, float] = (0.0, 0.0)
    """Estimated place, north, east about the estimator's origin, and its variance [m^2]."""
    variance: float = 0.0
    down: float = 0.0
    """Distance below the vehicle at the last measurement."""
    loiters: bool = False
    """Whether LOITER is held over it."""


@dataclass
class AvoidanceState:
    """Avoidance of the fence and of obstacles."""

    by_proximity: bool = True
    """Whether the switch of the transmitter admits avoidance by the proximity sensor."""
    velocity: Vector = (0.0, 0.0, 0.0)
    """Velocity that was last given, north, east, down [m/s]."""
    limited_at: Ns = NEVER
    """When avoidance last changed a velocity."""


@dataclass
class Aircraft:
    """Another aircraft: its last report, and the threat that it is. Lengths in metres, times in ns."""

    place: Vector
    """North, east, down about the estimator's origin."""
    velocity: Vector
    """North, east, down [m/s]."""
    at: Ns
    """Time of the report."""
    level: int = 0
    """MAV_COLLISION_THREAT_LEVEL."""
    nearest: float = 0.0
    """Least horizontal distance to come."""
    nearest_height: float = 0.0
    """Least vertical distance to come."""
    time: float = 0.0
    """Time until the least horizontal distance [s]."""
    reported_at: Ns = NEVER


@dataclass
class TrafficState:
    """Other aircraft, and the response to the most serious threat. Times in ns."""

    others: dict[tuple[int, int], Aircraft] = field(default_factory=dict)
    """By the kind of report and the address or system id."""
    level: int = 0
    """Level of threat that the vehicle responds to."""
    level_since: Ns = NEVER
    action: int = 0
    """MAV_COLLISION_ACTION that was last possible."""
    active: bool = False
    """Whether avoidance acts."""
    mode_before: int = 0
    """Number of the mode before avoidance."""
    mode_entered: int | None = None
    """Number of the mode that avoidance has entered."""
    threatened_at: Ns = NEVER
    """When a threat was last reported."""
