"""External poses for an autopilot's estimator: their age, what is refused, and when the estimate is reset.

A pose is compared with the estimate at its own time, and what differs is fused by ``flight_stack.estimator``.
Which poses count, and what their loss means, is stated by each firmware.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from math import isfinite, sqrt
from typing import Any, NamedTuple

from volery.base.frames import Vector, quaternion_to_euler, wrap
from volery.base.time import MS, Ns, to_seconds
from volery.links.mavlink_messages import constant
from volery.simulation.autopilots.flight_stack.flight_state import FUSE, REFUSE, RESET
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

HORIZON: Ns = 250 * MS
"""Age up to which a pose is compared with the estimate of its time; an older one counts as of that age."""
ACCEL_NOISE, PERIOD_S = 0.35, 0.01
"""EK3_ACC_P_NSE and EKF2_ACC_NOISE [m/s^2], of samples in that period [s]."""
DIAGONAL = (0, 6, 11, 15, 18, 20)
"""Places of the variances in the upper triangle of a 6 by 6 covariance."""
LOCAL_FRD, BODY_FRD = constant("MAV_FRAME_LOCAL_FRD"), constant("MAV_FRAME_BODY_FRD")


class AidingPose(NamedTuple):
    """An external pose.

    Args:
        stamp: Its time by the sender's clock [us].
        position: North, east, down about the estimator's origin [m].
        yaw: Clockwise from north [rad].
        variances: Of north, east, down [m^2], roll, pitch, yaw [rad^2]; zeros where nothing is stated.
        resets: Counts the jumps of its source.
    """

    stamp: int
    position: Vector
    yaw: float
    variances: tuple[float, ...]
    resets: int


def pose_of(name: str, fields: dict[str, Any]) -> AidingPose | None:
    """Return the pose in a VISION_POSITION_ESTIMATE or ODOMETRY; ``None``: it is not taken."""
    if name == "ODOMETRY":
        if (fields["frame_id"], fields["child_frame_id"]) != (LOCAL_FRD, BODY_FRD):
            return None
        q = fields["q"]
        yaw = quaternion_to_euler((q[0], q[1], q[2], q[3]))[2]
        stamp, covariance = fields["time_usec"], fields["pose_covariance"]
    else:
        yaw, stamp, covariance = fields["yaw"], fields["usec"], fields["covariance"]
    position = fields["x"], fields["y"], fields["z"]
    if not all(isfinite(one) for one in (*position, yaw)):
        return None
    stated = isfinite(covariance[0])
    variances = tuple(covariance[place] if stated else 0.0 for place in DIAGONAL)
    return AidingPose(stamp, position, yaw, variances, fields["reset_counter"])


class Fusion(NamedTuple):
    """How a firmware fuses poses now.

    Args:
        sigmas: Standard deviations of the pose, horizontal and vertical [m]; vertical 0: not used.
        heading: Whether its yaw is used.
        delay: Time that is subtracted from its time [ns].
        gate: Distance from which it is refused, in standard deviations.
        together: Whether that is tested for both axes together, not for each.
        retry: Time for which all poses are refused until the estimate is reset to one [ns].
        resets: Whether it may be reset.
        noise: Spectral density of the acceleration noise, by which the estimate becomes less sure while all
            poses are refused [m^2/s^3].
        drift: Standard deviations of its velocity [m/s] and acceleration [m/s^2], by which it does so, too.
    """

    sigmas: tuple[float, float]
    heading: bool
    delay: Ns
    gate: float
    together: bool
    retry: Ns
    resets: bool = True
    noise: float = ACCEL_NOISE * ACCEL_NOISE * PERIOD_S
    drift: tuple[float, float] = (0.0, 0.0)


@dataclass
class ExternalAiding:
    """Poses of one vehicle since its boot."""

    origin: bool = False
    """Whether the estimator has an origin."""
    placed: bool = False
    """Whether a user has set it."""
    used: bool = False
    """Whether the estimator fuses poses."""
    received_at: Ns = NEVER
    passed_at: Ns = NEVER
    """When the last pose came, and the last one that was fused."""
    interval: Ns = 0
    """Time between the last two poses."""
    resets: int = 0
    """How often the estimate was reset to a pose since the begin of the fusion."""
    lag: Ns | None = None
    """Smallest difference so far between arrival and stamp: it is taken for that of the clocks."""
    _sigma: float = 0.0
    """Standard deviation of the estimated position at ``passed_at`` [m]."""
    _jumps: int | None = None
    _past: deque[tuple[Ns, Vector, float]] = field(default_factory=deque)

    def age(self, vehicle: AutopilotVehicle, pose: AidingPose) -> Ns:
        """Return the age of a pose by its stamp: how much later it came than the quickest one."""
        difference = vehicle.kernel.now() - pose.stamp * 1000
        self.lag = difference if self.lag is None else min(self.lag, difference)
        return difference - self.lag

    def note_received(self, vehicle: AutopilotVehicle) -> None:
        """Note that a pose has come."""
        now = vehicle.kernel.now()
        self.interval = now - self.received_at if self.received_at != NEVER else HORIZON
        self.received_at = now

    def remember(self, vehicle: AutopilotVehicle) -> None:
        """Keep the estimate for poses that come later."""
        now, estimate = vehicle.kernel.now(), vehicle.estimate
        error = vehicle.flight.estimate_error
        north, east, down = estimate.position
        if error:
            north, east, down = north - error[0], east - error[1], down - error[2]
        self._past.append((now, (north, east, down), estimate.attitude[2]))
        while len(self._past) > 2 and self._past[1][0] <= now - HORIZON:
            self._past.popleft()

    def _at(self, time: Ns) -> tuple[Vector, float]:
        """Return the estimate at a time: position and yaw."""
        later = self._past[-1]
        for earlier in reversed(self._past):
            if earlier[0] <= time:
                share = (time - earlier[0]) / max(1, later[0] - earlier[0])
                x, y, z = (a + share * (b - a) for a, b in zip(earlier[1], later[1], strict=True))
                return (x, y, z), wrap(earlier[2] + share * wrap(later[2] - earlier[2]))
            later = earlier
        return later[1], later[2]

    def fuse(self, vehicle: AutopilotVehicle, pose: AidingPose, age: Ns, fusion: Fusion) -> bool:
        """Fuse a pose, refuse it, or reset the estimate to it; return whether it was used.

        Args:
            vehicle: The vehicle.
            pose: The pose.
            age: Its age.
            fusion: How it is fused.
        """
        now = vehicle.kernel.now()
        self.remember(vehicle)
        then, heading = self._at(now - min(age + fusion.delay, HORIZON))
        north, east, down = (there - here for there, here in zip(pose.position, then, strict=True))
        turn = wrap(pose.yaw - heading)
        jumped, self._jumps = self._jumps not in (None, pose.resets), pose.resets
        if not self.used or jumped:
            use = RESET
            self.resets = self.resets if self.used else 0
        elif not self._is_far(vehicle, north, east, fusion):
            use = FUSE
        elif now - self.passed_at < fusion.retry:
            use = REFUSE
        elif fusion.resets:
            use = RESET
            self.resets += 1
        else:
            self.used = False
            use = REFUSE
        vehicle.flight.use_pose(use, (north, east, down), turn, fusion.sigmas, by_heading=fusion.heading)
        if use == REFUSE:
            return False
        self.used, self.passed_at = True, now
        self._sigma = min(fusion.sigmas[0], vehicle.estimate.sigmas[0])
        if use == RESET:
            self._past.clear()
        return True

    def _is_far(self, vehicle: AutopilotVehicle, north: float, east: float, fusion: Fusion) -> bool:
        """Return whether a pose is beyond the gate."""
        passed = to_seconds(vehicle.kernel.now() - self.passed_at)
        drifted, tilted = fusion.drift[0] * passed, 0.5 * fusion.drift[1] * passed * passed
        estimated = self._sigma * self._sigma + fusion.noise * passed * passed * passed / 3.0
        estimated += drifted * drifted + tilted * tilted
        sigma = fusion.sigmas[0]
        reach = fusion.gate * sqrt(estimated + sigma * sigma)
        if fusion.together:
            return north * north + east * east >= 2.0 * reach * reach
        return max(abs(north), abs(east)) > reach


def place_origin(vehicle: AutopilotVehicle, aiding: ExternalAiding, fields: dict[str, Any]) -> bool:
    """Set the estimator's origin by SET_GPS_GLOBAL_ORIGIN, if it has none; return whether it was set."""
    latitude, longitude = fields["latitude"] / 1e7, fields["longitude"] / 1e7
    if fields["target_system"] not in (0, vehicle.system) or aiding.origin:
        return False
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        return False
    vehicle.flight.place_origin(latitude, longitude, fields["altitude"] / 1000.0)
    aiding.origin = aiding.placed = True
    return True
