"""External vision: poses from a companion computer in PX4's EKF2.

As in ``ev_control.cpp`` and ``ev_pos_control.cpp`` of 1.14 and 1.17: poses are the horizontal position while
no satellites are used; beside satellites only their drift would be learnt, which is left out. Velocities are
not taken. EKF2 says nothing to stations when it loses poses.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from volery.base.time import MS, Ns, S, from_seconds
from volery.simulation.autopilots.external_aiding import (
    HORIZON,
    AidingPose,
    ExternalAiding,
    Fusion,
    place_origin,
    pose_of,
)
from volery.simulation.autopilots.vehicle_state import FIX_3D, AutopilotVehicle

HORIZONTAL, VERTICAL, YAW = 1, 2, 8
"""Bits of EKF2_EV_CTRL."""
BY_VISION = 3
"""Value of EKF2_HGT_REF."""
BEGINS_WITHIN: Ns = 200 * MS
"""EV_MAX_INTERVAL: two poses within it begin the fusion, none within twice that time ends it."""
RETRY_AFTER: Ns = S
"""no_aid_timeout_max: all poses were refused for that time."""
RESETS = 5
"""Resets in flight until the fusion stops, and begins anew."""
LEAST_SIGMA = 0.01


def uses_satellites(vehicle: AutopilotVehicle) -> bool:
    """Return whether the parameters let EKF2 take its horizontal position from satellites."""
    return bool(round(vehicle.parameters["EKF2_GPS_CTRL"]) & 1)


class ExternalVision:
    """Poses of one vehicle since its boot.

    Args:
        vehicle: The vehicle.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        self._vehicle = vehicle
        self.aiding = ExternalAiding()
        self._ahead: Ns | None = None
        """The sender's clock less the time since boot, as TIMESYNC has found it."""
        self._quickest: Ns = S

    @property
    def _satellites(self) -> bool:
        """Whether EKF2 fuses positions by satellites now."""
        return uses_satellites(self._vehicle) and self._vehicle.estimate.fix_type >= FIX_3D

    def step(self) -> None:
        """Follow the parameters and the loss of poses; called at each tick."""
        vehicle, aiding = self._vehicle, self.aiding
        estimate, now = vehicle.estimate, vehicle.kernel.now()
        if not estimate.by_poses:
            aiding.origin = aiding.origin or estimate.position_ok
            if estimate.position_ok and not uses_satellites(vehicle):
                vehicle.flight.use_poses()
            return
        if aiding.used and now - aiding.received_at > 2 * BEGINS_WITHIN:
            aiding.used = False
        if self._satellites:
            aiding.used = False
            vehicle.flight.use_gps(True)
        if vehicle.home is None and vehicle.has_position:
            vehicle.set_home_here()

    def receive(self, name: str, fields: dict[str, Any]) -> None:
        """Take a VISION_POSITION_ESTIMATE or an ODOMETRY."""
        vehicle, aiding, pose = self._vehicle, self.aiding, pose_of(name, fields)
        bits = round(vehicle.parameters["EKF2_EV_CTRL"])
        if pose is None or not bits & HORIZONTAL:
            return
        aiding.note_received(vehicle)
        if not aiding.origin or self._satellites:
            return
        if not vehicle.estimate.by_poses:
            vehicle.flight.use_poses()
        if aiding.used or aiding.interval < BEGINS_WITHIN:
            aiding.fuse(vehicle, pose, self._age(pose), self._fusion(pose, bits))

    def _fusion(self, pose: AidingPose, bits: int) -> Fusion:
        vehicle, p = self._vehicle, self._vehicle.parameters
        stated = pose.variances if not p["EKF2_EV_NOISE_MD"] else (0.0,) * 3
        least = max(p["EKF2_EVP_NOISE"], LEAST_SIGMA)
        level, height = (sqrt(max(stated[axis], least * least)) for axis in (0, 2))
        by_vision = bool(bits & VERTICAL) and round(p["EKF2_HGT_REF"]) == BY_VISION
        return Fusion(
            sigmas=(level, height if by_vision else 0.0),
            heading=bool(bits & YAW),
            delay=from_seconds(p["EKF2_EV_DELAY"] / 1000.0),
            gate=max(1.0, p["EKF2_EVP_GATE"]),
            together=False,
            retry=RETRY_AFTER,
            resets=self.aiding.resets < RESETS or vehicle.landed,
        )

    def _age(self, pose: AidingPose) -> Ns:
        """Return the age of a pose; 0 as long as the sender's clock is not known."""
        if self._ahead is None:
            return 0
        return max(0, min(HORIZON, self._vehicle.uptime() - (pose.stamp * 1000 - self._ahead)))

    def note_time(self, fields: dict[str, Any]) -> None:
        """Take an answer to TIMESYNC."""
        sent, now = fields["ts1"], self._vehicle.uptime()
        if 0 <= now - sent <= self._quickest:
            self._quickest = now - sent
            self._ahead = fields["tc1"] - (sent + now) // 2

    def set_origin(self, fields: dict[str, Any]) -> None:
        """Take SET_GPS_GLOBAL_ORIGIN."""
        if place_origin(self._vehicle, self.aiding, fields):
            self._vehicle.output.send_message("GPS_GLOBAL_ORIGIN")
