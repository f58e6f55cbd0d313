"""ArduPilot's proximity sensor: distances in eight directions, from messages or from the fence.

With PRX1_TYPE 2 distances come by DISTANCE_SENSOR, OBSTACLE_DISTANCE and OBSTACLE_DISTANCE_3D; with 10 the
sensor of the original's simulator measures up to the uploaded fence. Directions are eighths of a turn,
clockwise from the nose. Only obstacles within 15 degrees of the vehicle's level count. PRX1_TYPE counts from
the next boot on.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import degrees, hypot, inf, pi, radians
from typing import Any

from volery.base.elementary import atan2, cos, sin
from volery.base.time import MS, Ns, S, to_seconds
from volery.simulation.autopilots.ardupilot.feature import ArmingCheck, Feature, Kept, LogForm
from volery.simulation.autopilots.ardupilot.fence_shapes import Level, shapes
from volery.simulation.autopilots.mavlink.messages import Fields, all_within, boot_ms, to_uint16
from volery.simulation.autopilots.onboard_log import LogRow
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

MESSAGES, FENCE = 2, 10
"""PRX1_TYPE: distances come by messages, or the fence is measured."""

DIRECTIONS = 8
UPWARD = 24
"""MAV_SENSOR_ORIENTATION of a distance above the vehicle."""
BODY_FRD = 12
"""MAV_FRAME."""
FIRST_ID = 10
"""Id of the report of the first direction; the distance above has the id after the next of the last one."""

SILENCE = 500 * MS
"""Time without a message after which the sensor is unhealthy [ns]."""
FORGOTTEN = S
"""Time after which a distance no longer counts, and the low-pass begins anew [ns]."""
TOGETHER = 50 * MS
"""Messages with one time stamp belong together if they come within this time [ns]."""
LEVEL = radians(15.0)
"""Largest elevation of an obstacle that counts [rad]."""
FARTHEST_FENCE, FENCE_ACCURACY = 200.0, 0.1
"""Range and resolution of the sensor that measures the fence [m]."""
NEAREST_EDGE = 0.6
"""Least distance of the boundary about the vehicle [m]."""
SENSOR = 1 << 26
"""MAV_SYS_STATUS_SENSOR."""


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


proximity_of = Kept(ProximityState)


def update_proximity(vehicle: AutopilotVehicle) -> None:
    """Forget old distances, and measure the fence, at each tick."""
    sensor, now = proximity_of(vehicle), vehicle.kernel.now()
    if sensor.kind is None:
        sensor.kind = round(vehicle.parameters["PRX1_TYPE"])
    if sensor.kind == FENCE:
        _measure_fence(vehicle)
    for direction, at in sensor.measured_at.items():
        if now - at > FORGOTTEN:
            sensor.distances.pop(direction, None)


def is_healthy(vehicle: AutopilotVehicle) -> bool:
    """Return whether there is a proximity sensor, and it measures."""
    sensor, now = proximity_of(vehicle), vehicle.kernel.now()
    if sensor.kind == MESSAGES:
        return now - max(sensor.received_at, sensor.upward_at) <= SILENCE
    return sensor.kind == FENCE and any(shape.inside for shape in shapes(vehicle))


def is_there(vehicle: AutopilotVehicle) -> bool:
    """Return whether the vehicle has booted with a proximity sensor."""
    return proximity_of(vehicle).kind in (MESSAGES, FENCE)


def lacks_data(vehicle: AutopilotVehicle) -> bool:
    """Return whether there is a proximity sensor that does not measure."""
    return is_there(vehicle) and not is_healthy(vehicle)


def closest(vehicle: AutopilotVehicle) -> tuple[float, float] | None:
    """Return the least distance [m] and its angle from the nose [degrees]; ``None`` without an obstacle."""
    sensor = proximity_of(vehicle)
    return min(((far, sensor.angles[direction]) for direction, far in sensor.distances.items()), default=None)


def upward(vehicle: AutopilotVehicle) -> float | None:
    """Return the distance above the vehicle [m]; ``None``: not measured."""
    sensor = proximity_of(vehicle)
    if sensor.kind == FENCE:
        return max(0.0, vehicle.parameters["FENCE_ALT_MAX"] - vehicle.height) if vehicle.flies else None
    fresh = sensor.kind == MESSAGES and vehicle.kernel.now() - sensor.upward_at <= SILENCE
    return sensor.upward if fresh else None


def edges(vehicle: AutopilotVehicle) -> list[tuple[Level, Level]]:
    """Return the boundary about the vehicle: the two ends of each edge, forward and right [m].

    A corner lies between two directions at the lesser of their distances; beside the last direction with an
    obstacle the boundary goes on by one more corner.
    """
    sensor = proximity_of(vehicle)
    known = {direction: sensor.filtered[direction] for direction in sensor.distances}
    corners = [_corner(known, direction) for direction in range(DIRECTIONS)]
    pairs = zip(corners, (*corners[1:], corners[0]), strict=True)
    return [(start, end) for start, end in pairs if start is not None and end is not None]


def _corner(known: dict[int, float], direction: int) -> Level | None:
    """Return the corner between a direction and the next, forward and right [m]; ``None``: open."""
    for group in ((direction, direction + 1), (direction - 1,), (direction + 2,)):
        distances = [known[one % DIRECTIONS] for one in group if one % DIRECTIONS in known]
        if distances:
            far, angle = max(NEAREST_EDGE, min(distances)), radians(45.0 * direction + 22.5)
            return far * cos(angle), far * sin(angle)
    return None


# -- measurements


def _store(vehicle: AutopilotVehicle, direction: int, far: float, angle: float) -> None:
    """Store a distance [m] at an angle from the nose [degrees], and pass it through the low-pass."""
    sensor, now = proximity_of(vehicle), vehicle.kernel.now()
    passed, cutoff = now - sensor.measured_at.get(direction, NEVER), vehicle.parameters["PRX_FILT"]
    before = sensor.filtered.get(direction, far)
    share = 1.0
    if passed < FORGOTTEN and cutoff > 0.0:
        share = to_seconds(passed) / (to_seconds(passed) + 1.0 / (2.0 * pi * cutoff))
    sensor.distances[direction], sensor.angles[direction] = far, angle
    sensor.filtered[direction] = before + share * (far - before)
    sensor.measured_at[direction] = now


def _measure_fence(vehicle: AutopilotVehicle) -> None:
    sensor, uploaded = proximity_of(vehicle), shapes(vehicle)
    if not any(shape.inside for shape in uploaded):
        return
    sensor.range = (0.0, FARTHEST_FENCE)
    north, east, _ = vehicle.estimate.position
    heading = vehicle.estimate.attitude[2]
    for direction in range(DIRECTIONS):
        angle = heading + radians(45.0 * direction)
        near, far = 0.0, FARTHEST_FENCE
        while far - near > FENCE_ACCURACY:
            middle = 0.5 * (near + far)
            place = (north + middle * cos(angle), east + middle * sin(angle))
            if all(shape.admits(place) for shape in uploaded):
                near = middle
            else:
                far = middle
        _store(vehicle, direction, near, 45.0 * direction)


def _direction(angle: float) -> int:
    """Return the direction of an angle from the nose [degrees]."""
    return int((angle + 22.5) % 360.0 // 45.0)


def _is_admitted(vehicle: AutopilotVehicle, far: float) -> bool:
    """Return whether a distance [m] is within PRX1_MIN and PRX1_MAX, of which 0 is no limit."""
    least, largest = vehicle.parameters["PRX1_MIN"], vehicle.parameters["PRX1_MAX"]
    return far >= least and (largest == 0.0 or far <= largest)


def _begin(vehicle: AutopilotVehicle, stamp: int) -> ProximityState:
    """Note a message; with a new time stamp the distances that were collected before it count from now on."""
    sensor, now = proximity_of(vehicle), vehicle.kernel.now()
    if stamp != sensor.stamp or now - sensor.received_at > TOGETHER:
        for direction, (far, angle) in sensor.collected.items():
            _store(vehicle, direction, far, angle)
        sensor.collected.clear()
    sensor.stamp, sensor.received_at = stamp, now
    return sensor


def _collect(sensor: ProximityState, far: float, angle: float) -> None:
    direction = _direction(angle)
    if far < sensor.collected.get(direction, (inf, 0.0))[0]:
        sensor.collected[direction] = (far, angle)


def on_distance_sensor(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle DISTANCE_SENSOR of a direction, or upward."""
    orientation, far = fields["orientation"], fields["current_distance"] / 100.0
    if proximity_of(vehicle).kind != MESSAGES:
        return
    if orientation < DIRECTIONS:
        sensor = _begin(vehicle, fields["time_boot_ms"])
        sensor.range = (fields["min_distance"] / 100.0, fields["max_distance"] / 100.0)
        if sensor.range[0] <= far <= sensor.range[1] and _is_admitted(vehicle, far):
            _collect(sensor, far, 45.0 * orientation)
    elif orientation == UPWARD:
        proximity_of(vehicle).upward, proximity_of(vehicle).upward_at = far, vehicle.kernel.now()


def on_obstacle_distance(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle OBSTACLE_DISTANCE: distances at equal steps of the angle, the nearest by direction counts."""
    sensor = proximity_of(vehicle)
    offset = fields.get("angle_offset", 0.0)
    step = fields.get("increment_f", 0.0) or float(fields["increment"])
    if sensor.kind != MESSAGES or not step or not all_within((step, offset)):
        return
    sensor.received_at = vehicle.kernel.now()
    sensor.range = (fields["min_distance"] / 100.0, fields["max_distance"] / 100.0)
    offset += vehicle.parameters["PRX1_YAW_CORR"]
    count = min(int(360.0 / abs(step) + 0.5), len(fields["distances"]))
    clockwise = -step if vehicle.parameters["PRX1_ORIENT"] else step
    sensor.distances.clear()
    nearest: dict[int, tuple[float, float]] = {}
    for place, cm in enumerate(fields["distances"][:count]):
        angle = (offset + place * clockwise) % 360.0
        unknown = cm in (0, 65_535) or not fields["min_distance"] <= cm <= fields["max_distance"]
        if not unknown and _is_admitted(vehicle, cm / 100.0):
            direction = _direction(angle)
            nearest[direction] = min(nearest.get(direction, (inf, 0.0)), (cm / 100.0, angle))
    for direction, (far, angle) in nearest.items():
        _store(vehicle, direction, far, angle)


def on_obstacle_3d(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle OBSTACLE_DISTANCE_3D: a point forward, right and down of the vehicle."""
    if proximity_of(vehicle).kind != MESSAGES:
        return
    if fields["frame"] != BODY_FRD:
        proximity_of(vehicle).stamp, proximity_of(vehicle).received_at = (
            fields["time_boot_ms"],
            vehicle.kernel.now(),
        )
        return
    point, limits = (fields["x"], fields["y"], fields["z"]), (fields["min_distance"], fields["max_distance"])
    sensor = _begin(vehicle, fields["time_boot_ms"])
    if not all_within((*point, *limits)):
        return
    sensor.range = limits
    far = hypot(*point)
    if far <= 0.0 or not limits[0] <= far <= limits[1] or not _is_admitted(vehicle, far):
        return
    if abs(atan2(point[2], hypot(point[0], point[1]))) <= LEVEL:
        _collect(sensor, far, degrees(atan2(point[1], point[0])) % 360.0)


# -- reports


LEVEL_LAYER = 2
"""Number of the layer of the vehicle's level among the original's five."""
NO_DATA, GOOD = 1, 2
"""Health in the log."""


def log_rows(vehicle: AutopilotVehicle) -> tuple[LogRow, ...]:
    """Return PRX, and with PRX_LOG_RAW also PRXR, while there is a distance; open directions: the range."""
    sensor = proximity_of(vehicle)
    nearest = closest(vehicle)
    if nearest is None:
        return ()
    known, filtered = sensor.distances, sensor.filtered
    health = GOOD if is_healthy(vehicle) else NO_DATA
    smooth = (filtered[one] if one in known else sensor.range[1] for one in range(DIRECTIONS))
    far, angle = nearest
    rows: list[LogRow] = [
        ("PRX", (LEVEL_LAYER, health, *smooth, upward(vehicle) or 0.0, angle, far)),
    ]
    if vehicle.parameters["PRX_LOG_RAW"]:
        raw = (known.get(one, sensor.range[1]) for one in range(DIRECTIONS))
        rows.append(("PRXR", (LEVEL_LAYER, *raw)))
    return tuple(rows)


def reports(vehicle: AutopilotVehicle) -> list[Fields]:
    """Return DISTANCE_SENSOR of each direction with a distance, and upward."""
    sensor = proximity_of(vehicle)
    measured = [(direction, direction, sensor.distances[direction]) for direction in sorted(sensor.distances)]
    above = upward(vehicle)
    if above is not None:
        measured.append((DIRECTIONS + 1, UPWARD, above))
    least, largest = (to_uint16(100.0 * limit) for limit in sensor.range)
    return [
        {
            "time_boot_ms": boot_ms(vehicle),
            "min_distance": least,
            "max_distance": largest,
            "current_distance": to_uint16(100.0 * far),
            "orientation": orientation,
            "id": FIRST_ID + number,
        }
        for number, orientation, far in measured
    ]


def _amend_status(vehicle: AutopilotVehicle, status: Fields) -> Fields:
    """Return SYS_STATUS with the sensor, if there is one."""
    if not is_there(vehicle):
        return status
    present, enabled, health = (
        f"onboard_control_sensors_{name}" for name in ("present", "enabled", "health")
    )
    healthy = status[health] | SENSOR if is_healthy(vehicle) else status[health] & ~SENSOR
    return {
        **status,
        present: status[present] | SENSOR,
        enabled: status[enabled] | SENSOR,
        health: healthy,
    }


COPTER = ROVER = Feature(
    parameters={
        "PRX1_MAX": ("m", "largest distance of the proximity sensor that counts; 0: any"),
        "PRX1_MIN": ("m", "least distance of the proximity sensor that counts"),
        "PRX1_ORIENT": ("", "any value but 0: OBSTACLE_DISTANCE counts anticlockwise"),
        "PRX1_TYPE": ("", "from the next boot on: 2 distances come by messages, 10 the fence is measured"),
        "PRX1_YAW_CORR": ("°", "angle that is added to those of OBSTACLE_DISTANCE"),
        "PRX_LOG_RAW": ("", "any value but 0: the log has distances before the low-pass, too"),
        "PRX_FILT": ("Hz", "cut-off frequency of the distances that avoidance reads; 0: no filter"),
    },
    messages={
        "DISTANCE_SENSOR": on_distance_sensor,
        "OBSTACLE_DISTANCE": on_obstacle_distance,
        "OBSTACLE_DISTANCE_3D": on_obstacle_3d,
    },
    checks=(ArmingCheck("PRX1: No Data", lacks_data),),
    on_tick=update_proximity,
    amends={"SYS_STATUS": _amend_status},
    extends={"DISTANCE_SENSOR": reports},
    log_forms=(
        LogForm(
            137,
            "PRX",
            "QBBfffffffffff",
            "TimeUS,Layer,He,D0,D45,D90,D135,D180,D225,D270,D315,DUp,CAn,CDis",
        ),
        LogForm(138, "PRXR", "QBffffffff", "TimeUS,Layer,D0,D45,D90,D135,D180,D225,D270,D315"),
    ),
    log_rows=log_rows,
)
