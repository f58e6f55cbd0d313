"""The mission item NAV_PAYLOAD_PLACE: fly to a place, sink until the load stands, release it, climb back.

The sequence and its texts are those of ArduCopter's ``PayloadPlace``. No load hangs below the copter here: it
is put down when the copter itself has landed, and PLDP_THRESH, the loss of thrust, has no effect.
"""

from __future__ import annotations

from enum import Enum, auto

from volery.base.frames import Vector
from volery.base.time import MS, from_seconds
from volery.simulation.autopilots.ardupilot.feature import Feature, MissionCommand
from volery.simulation.autopilots.ardupilot.payload import LET_GO, move_gripper
from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import Leg, item_point
from volery.simulation.autopilots.manoeuvres.to_point import ToPoint, stopping_point
from volery.simulation.autopilots.onboard_mission import PAYLOAD_PLACE, MissionItem
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre
from volery.trace.events import INFO, WARNING

SETTLES = 500 * MS
"""Time from touch-down to the end of PLDP_DELAY, beside it [ns]."""
SLOW_SHARE = 0.1
"""Share of the climb rate from which the climb counts as ended."""


class _PlaceStage(Enum):
    FLY, SINK, RELEASE, WAIT, CLIMB, DONE = auto(), auto(), auto(), auto(), auto(), auto()


def payload_leg(vehicle: AutopilotVehicle, item: MissionItem) -> Leg:
    """Return the leg of an item NAV_PAYLOAD_PLACE; its param1 is the farthest descent [m], 0: any."""
    point = item_point(vehicle, item) if item.has_place else None
    placing = PlacePayload(vehicle, point, item.param1)
    return Leg(placing, placing.goes_on)


class PlacePayload(FlightManoeuvre):
    """Place the load.

    Args:
        vehicle: The vehicle.
        point: Where, north, east, down about the estimator's origin [m]; ``None``: below the vehicle. The
            flight there keeps the present height.
        farthest: Farthest descent [m]; 0: any.
    """

    def __init__(self, vehicle: AutopilotVehicle, point: Vector | None, farthest: float) -> None:
        super().__init__(vehicle)
        here = vehicle.estimate.position
        self._going = ToPoint(vehicle, None if point is None else (point[0], point[1], here[2]))
        self._stage = _PlaceStage.SINK if point is None else _PlaceStage.FLY
        self._farthest = farthest
        self._start = here
        """Where the descent began and the climb ends."""
        self._down_at = 0
        """When the load stood [ns]."""

    def enter(self) -> None:
        """Begin with the flight, or with the descent."""
        self._going.enter()
        self.target = self._going.target
        if self._stage is _PlaceStage.SINK:
            self._sink()

    def takeoff_requested(self) -> bool:
        """Return whether the copter climbs back from the ground."""
        return self._stage in (_PlaceStage.CLIMB, _PlaceStage.DONE)

    def _sink(self) -> None:
        estimate, tuning = self.vehicle.estimate, self.vehicle.tuning
        if self._stage is _PlaceStage.FLY and self._going.point is not None:
            self._start = self._going.point
        else:
            self._start = stopping_point(estimate.position, estimate.velocity, tuning.accel, tuning.accel_z)
        self._stage = _PlaceStage.SINK
        self.target = None

    def _say(self, severity: int, text: str) -> None:
        self.vehicle.send_text(severity, f"PayloadPlace: {text}")

    def goes_on(self) -> bool:
        """Continue the sequence, at each tick, also on the ground; return whether it has ended."""
        vehicle, now = self.vehicle, self.vehicle.kernel.now()
        if self._stage is _PlaceStage.FLY and self._going.arrived():
            self._sink()
        if outputs_of(vehicle).gripper == LET_GO and self._stage in (_PlaceStage.FLY, _PlaceStage.SINK):
            self._say(INFO, "Manual release")
            self._stage, self._down_at = (
                (_PlaceStage.WAIT if self._stage is _PlaceStage.SINK else _PlaceStage.DONE),
                now,
            )
        elif self._stage is _PlaceStage.SINK:
            self._watch_descent()
        elif self._stage is _PlaceStage.RELEASE and outputs_of(vehicle).gripper == LET_GO:
            self._stage = _PlaceStage.WAIT
        if self._stage is _PlaceStage.WAIT:
            delay = from_seconds(max(0.0, vehicle.parameters["PLDP_DELAY"]))
            if now - self._down_at >= SETTLES + delay:
                self._climb()
        elif self._stage is _PlaceStage.CLIMB and not vehicle.landed and self._has_climbed():
            self._stage = _PlaceStage.DONE
        return self._stage is _PlaceStage.DONE

    def _watch_descent(self) -> None:
        vehicle = self.vehicle
        if vehicle.landed:
            self._say(INFO, "landed")
            self._down_at = vehicle.kernel.now()
            if vehicle.parameters["GRIP_ENABLE"]:
                self._say(INFO, "Releasing the gripper")
                move_gripper(vehicle, LET_GO)
                self._stage = _PlaceStage.RELEASE
            else:
                self._stage = _PlaceStage.WAIT
        elif 0.0 < self._farthest < vehicle.estimate.position[2] - self._start[2]:
            self._say(WARNING, "Reached maximum descent")
            self._climb()

    def _climb(self) -> None:
        north, east, _ = self.vehicle.estimate.position
        self._going = ToPoint(self.vehicle, (north, east, self._start[2]))
        self._going.enter()
        self._stage = _PlaceStage.CLIMB

    def _has_climbed(self) -> bool:
        tuning = self.vehicle.tuning
        speed = SLOW_SHARE * tuning.speed_up
        stops = 0.5 * speed * speed / tuning.accel_z
        return self.vehicle.estimate.target[2] <= self._start[2] + stops

    def step(self) -> None:
        """Fly level, sink, wait, or climb."""
        if self._stage in (_PlaceStage.FLY, _PlaceStage.CLIMB, _PlaceStage.DONE):
            self._going.step()
            return
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        stated = vehicle.parameters["PLDP_SPEED_DN"]
        sink = min(stated if stated > 0.0 else tuning.land_speed, tuning.speed_down)
        vehicle.drive(
            Setpoint(
                Control.POSITION_CLIMB,
                position=self._start,
                climb=-sink if self._stage is _PlaceStage.SINK else 0.0,
                yaw=vehicle.commanded.yaw,
                speed=tuning.speed,
                speed_down=max(tuning.speed_down, sink),
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )


COPTER = Feature(
    parameters={
        "PLDP_DELAY": ("s", "time between the release of a load and the climb"),
        "PLDP_SPEED_DN": ("m/s", "rate of descent to put down a load; 0: LAND_SPEED"),
    },
    items={PAYLOAD_PLACE: MissionCommand("PayloadPlace", leg=payload_leg, placed=True)},
)
ROVER = Feature(items={PAYLOAD_PLACE: MissionCommand("PayloadPlace", placed=True)})
