"""The state of a simulated vehicle by owner: home, arming, ground, commanded limits, failsafes, reports.

``Vehicle`` holds one of each, and replaces all of them at a boot. What only one firmware keeps stands there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

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
    motors_stopped_at: Ns = NEVER
    """Since when a switch or a command has kept the motors from turning."""


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
    backwards: bool = False
    """Whether a rover drives to points backwards."""

    def forget_heading(self) -> None:
        """Leave the heading to the target that is flown to."""
        self.yaw = self.look_at = None
        self.yaw_left = 0.0

    def forget_speeds(self) -> None:
        """Return to the firmware's own speeds."""
        self.speed = self.speed_up = self.speed_down = None


@dataclass
class FailsafeState:
    """Failsafes in force."""

    active: set[str] = field(default_factory=set)
    """Names of the failsafes whose condition is true."""


@dataclass
class ReportState:
    """What a firmware has reported since boot."""

    sent_once: set[str] = field(default_factory=set)
    """Texts that are sent once after a boot."""
    gauge_offset_mah: float = 0.0
    """Charge that the battery's gauge counts beyond what was drawn [mAh]."""
