"""ArduPilot's avoidance: velocities are limited before the fence and before obstacles.

A copter's velocity in LOITER, GUIDED, FOLLOW and ZIGZAG slides along a limit (AVOID_BEHAVE 0) or is
shortened (1), its climb ends below the ceiling, and in ALT_HOLD it leans away from obstacles. A rover's speed
is limited in all modes but MANUAL and HOLD. Within the margin of a limit the vehicle backs away. A fence that
has been breached limits nothing. The speed before a limit follows from the distance by a square-root law,
for a copter with a gain near the limit.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import hypot, inf, pi, radians, sqrt
from typing import NamedTuple

from volery.base.elementary import atan2, cos, sin
from volery.base.frames import Vector, turn_clockwise
from volery.base.time import MS, Ns, to_seconds
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept, build_of
from volery.simulation.autopilots.ardupilot.fence import CEILING, CIRCLE, POLYGON, fence_of
from volery.simulation.autopilots.ardupilot.fence_shapes import FenceCircle, Level, Shape, shapes
from volery.simulation.autopilots.ardupilot.proximity import closest, edges, is_healthy, proximity_of, upward
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.flight_stack.guidance import approach
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

BY_FENCE, BY_PROXIMITY = 1, 2
"""Bits of AVOID_ENABLE."""
BRAKE = 1.0
"""Largest deceleration before a limit [m/s^2]."""
BACK_SHARE = 0.4
"""Share of that deceleration for backing away."""
GAIN = 1.0
"""PSC_POSXY_P and PSC_POSZ_P [1/s]."""
RESTART = 200 * MS
"""Time without a limited velocity after which the limit of acceleration begins anew [ns]."""
PROXIMITY_SWITCH = 40
"""RCn_OPTION."""


@dataclass
class AvoidanceState:
    """Avoidance of the fence and of obstacles."""

    by_proximity: bool = True
    """Whether the switch of the transmitter admits avoidance by the proximity sensor."""
    velocity: Vector = (0.0, 0.0, 0.0)
    """Velocity that was last given, north, east, down [m/s]."""
    limited_at: Ns = NEVER
    """When avoidance last changed a velocity."""


avoidance_of = Kept(AvoidanceState)


class StoppingLaw(NamedTuple):
    """How a vehicle closes in on a limit.

    Args:
        gain: Closing speed over distance near the limit [1/s]; 0: the square root alone.
        brake: Deceleration [m/s^2].
        stops: Whether velocities are shortened; else they slide along the limit.
    """

    gain: float
    brake: float
    stops: bool

    def speed(self, distance: float, share: float = 1.0) -> float:
        """Return the speed [m/s] at a distance before the limit [m], for a share of the deceleration."""
        distance, brake = max(0.0, distance), share * self.brake
        return approach(distance, self.gain, brake) if self.gain else sqrt(2.0 * brake * distance)

    def stopping_distance(self, speed: float) -> float:
        """Return the distance [m] in which a speed [m/s] ends."""
        if self.gain and speed < self.brake / self.gain:
            return speed / self.gain
        linear = self.brake / (2.0 * self.gain * self.gain) if self.gain else 0.0
        return linear + speed * speed / (2.0 * self.brake)


class _Retreat:
    """Velocity away from limits: the largest components in each quadrant, summed over the quadrants."""

    def __init__(self) -> None:
        self._quadrants: dict[tuple[bool, bool], Level] = {}

    def add(self, towards: Level, speed: float) -> None:
        """Add a speed [m/s] away from the point in direction *towards*."""
        far = hypot(*towards)
        if far == 0.0 or speed <= 0.0:
            return
        x, y = -speed * towards[0] / far, -speed * towards[1] / far
        before_x, before_y = self._quadrants.get((x < 0.0, y < 0.0), (0.0, 0.0))
        self._quadrants[x < 0.0, y < 0.0] = (max(x, before_x, key=abs), max(y, before_y, key=abs))

    def total(self) -> Level:
        """Return the velocity [m/s]."""
        return sum(x for x, _ in self._quadrants.values()), sum(y for _, y in self._quadrants.values())


# -- limits of a horizontal velocity


def _towards_edge(place: Level, start: Level, end: Level) -> Level:
    """Return the vector to the point of an edge that is closest to *place*."""
    along = (end[0] - start[0], end[1] - start[1])
    length = along[0] * along[0] + along[1] * along[1]
    share = 0.0
    if length > 0.0:
        share = ((place[0] - start[0]) * along[0] + (place[1] - start[1]) * along[1]) / length
    share = min(1.0, max(0.0, share))
    return start[0] + share * along[0] - place[0], start[1] + share * along[1] - place[1]


def _to_crossing(place: Level, direction: Level, start: Level, end: Level) -> float:
    """Return the distance at which a ray from *place* crosses an edge; infinite if it does not."""
    along = (end[0] - start[0], end[1] - start[1])
    across = direction[0] * along[1] - direction[1] * along[0]
    if across == 0.0:
        return inf
    to_start = (start[0] - place[0], start[1] - place[1])
    far = (to_start[0] * along[1] - to_start[1] * along[0]) / across
    share = (to_start[0] * direction[1] - to_start[1] * direction[0]) / across
    return far if far >= 0.0 and 0.0 <= share <= 1.0 else inf


def _towards_limit(velocity: Level, towards: Level, most: float) -> Level:
    """Limit the component of a velocity in direction *towards* to a speed."""
    far = hypot(*towards)
    excess = (velocity[0] * towards[0] + velocity[1] * towards[1]) / far - most if far else 0.0
    if excess <= 0.0:
        return velocity
    return velocity[0] - excess * towards[0] / far, velocity[1] - excess * towards[1] / far


def _shortened(velocity: Level, most: float) -> Level:
    speed = hypot(*velocity)
    share = most / speed if speed > most else 1.0
    return velocity[0] * share, velocity[1] * share


def _within_edges(
    velocity: Level, place: Level, boundary: Iterable[tuple[Level, Level]], margin: float, law: StoppingLaw
) -> Level:
    """Limit a velocity before the edges of a polygon or of obstacles."""
    speed = hypot(*velocity)
    if speed == 0.0:
        return velocity
    direction = (velocity[0] / speed, velocity[1] / speed)
    for start, end in boundary:
        if law.stops:
            far = _to_crossing(place, direction, start, end)
            velocity = _shortened(velocity, law.speed(far - margin)) if far < inf else velocity
        else:
            towards = _towards_edge(place, start, end)
            velocity = _towards_limit(velocity, towards, law.speed(hypot(*towards) - margin))
    return velocity


def _within_circle(
    velocity: Level, place: Level, circle: FenceCircle, margin: float, law: StoppingLaw
) -> Level:
    """Limit a velocity inside or outside of a circle."""
    offset = (place[0] - circle.centre[0], place[1] - circle.centre[1])
    away, speed = hypot(*offset), hypot(*velocity)
    free = circle.radius - margin if circle.inside else circle.radius + margin
    if speed == 0.0:
        return velocity
    if not law.stops and not circle.inside:
        return _towards_limit(velocity, (-offset[0], -offset[1]), law.speed(away - free))
    ahead = law.stopping_distance(speed) + (margin if law.stops else 0.0)
    end = (offset[0] + velocity[0] / speed * ahead, offset[1] + velocity[1] / speed * ahead)
    if law.stops:
        beyond = away >= free if circle.inside else away < free
        if beyond:
            closes_in = hypot(*end) >= away if circle.inside else hypot(*end) <= away
            return (0.0, 0.0) if closes_in else velocity
        return _shortened(velocity, law.speed(_to_circle(offset, velocity, free)))
    if hypot(*end) <= free:
        return velocity
    # slide: to the point of the circle that is next to where the vehicle would stop
    target = (end[0] * free / hypot(*end) - offset[0], end[1] * free / hypot(*end) - offset[1])
    far = hypot(*target)
    share = min(speed, law.speed(far)) / far if far else 0.0
    return target[0] * share, target[1] * share


def _to_circle(offset: Level, velocity: Level, radius: float) -> float:
    """Return the distance from a place along a velocity to a circle about the origin; infinite if none."""
    speed = hypot(*velocity)
    along = (offset[0] * velocity[0] + offset[1] * velocity[1]) / speed
    root = along * along - offset[0] * offset[0] - offset[1] * offset[1] + radius * radius
    if root < 0.0:
        return inf
    near, far = -along - sqrt(root), -along + sqrt(root)
    return near if near >= 0.0 else far if far >= 0.0 else inf


def _away_from(place: Level, shape: Shape) -> list[tuple[Level, float]]:
    """Return the vectors to the limits of a shape, and the distances to them."""
    if isinstance(shape, FenceCircle):
        to_centre = (shape.centre[0] - place[0], shape.centre[1] - place[1])
        away = hypot(*to_centre)
        return [((-to_centre[0], -to_centre[1]) if shape.inside else to_centre, abs(shape.radius - away))]
    vectors = [_towards_edge(place, start, end) for start, end in shape.edges()]
    return [(vector, hypot(*vector)) for vector in vectors]


def _fence_shapes(vehicle: AutopilotVehicle) -> list[Shape]:
    """Return the shapes of the fence that limit: those that are not breached and have room for the margin."""
    parameters, home = vehicle.parameters, vehicle.home
    types = round(parameters["FENCE_TYPE"])
    found: list[Shape] = []
    if types & CIRCLE and home is not None and CIRCLE not in fence_of(vehicle).breached:
        found.append(FenceCircle((home.ned[0], home.ned[1]), parameters["FENCE_RADIUS"], True))
    if types & POLYGON:
        found += shapes(vehicle)
    north, east, _ = vehicle.estimate.position
    margin = parameters["FENCE_MARGIN"]
    return [
        shape
        for shape in found
        if shape.admits((north, east)) and not (isinstance(shape, FenceCircle) and shape.radius < margin)
    ]


CREEPS = 0.04
"""Distance beyond the fence at which a velocity of GUIDED would end [m]: the copter creeps over the limit."""


def _fence_margin(vehicle: AutopilotVehicle) -> float:
    """Return the distance that avoidance keeps from the fence [m].

    Velocities of GUIDED do not keep FENCE_MARGIN: 6 m/s outwards from home cross a circle of 60 m after
    14.9 s, and the ceiling is crossed as well (recorded of 4.5.6).
    """
    if vehicle.flies and vehicle.mode.name == "GUIDED":
        return -CREEPS
    return max(0.0, vehicle.parameters["FENCE_MARGIN"])


def _uses_fence(vehicle: AutopilotVehicle) -> bool:
    on = round(vehicle.parameters["AVOID_ENABLE"]) & BY_FENCE and vehicle.parameters["FENCE_ENABLE"]
    return bool(on) and vehicle.position_ok


def _uses_proximity(vehicle: AutopilotVehicle) -> bool:
    admitted = avoidance_of(vehicle).by_proximity and is_healthy(vehicle)
    return admitted and bool(round(vehicle.parameters["AVOID_ENABLE"]) & BY_PROXIMITY)


def _is_low(vehicle: AutopilotVehicle) -> bool:
    """Return whether a copter is below AVOID_ALT_MIN by its rangefinder, where obstacles do not count."""
    parameters = vehicle.parameters
    height = vehicle.estimate.rangefinder if vehicle.flies and parameters["RNGFND1_TYPE"] else None
    return height is not None and height < parameters["AVOID_ALT_MIN"]


def _limited_level(vehicle: AutopilotVehicle, velocity: Level, law: StoppingLaw) -> tuple[Level, Level]:
    """Return a horizontal velocity within the limits, and the velocity of backing away [m/s]."""
    parameters, away = vehicle.parameters, _Retreat()
    if _uses_proximity(vehicle) and not _is_low(vehicle):
        heading, margin = vehicle.estimate.attitude[2], max(0.0, parameters["AVOID_MARGIN"])
        boundary = edges(vehicle)
        ahead, back = turn_clockwise(velocity, -heading), _Retreat()
        for start, end in boundary:
            towards = _towards_edge((0.0, 0.0), start, end)
            breach = margin - hypot(*towards)
            if breach > max(0.0, parameters["AVOID_BACKUP_DZ"]):
                back.add(towards, law.speed(breach, BACK_SHARE))
        velocity = turn_clockwise(_within_edges(ahead, (0.0, 0.0), boundary, margin, law), heading)
        retreat = turn_clockwise(back.total(), heading)
        away.add((-retreat[0], -retreat[1]), hypot(*retreat))
    if _uses_fence(vehicle):
        north, east, _ = vehicle.estimate.position
        margin = _fence_margin(vehicle)
        for shape in _fence_shapes(vehicle):
            for towards, far in _away_from((north, east), shape):
                away.add(towards, law.speed(margin - far, BACK_SHARE))
            if isinstance(shape, FenceCircle):
                velocity = _within_circle(velocity, (north, east), shape, margin, law)
            else:
                velocity = _within_edges(velocity, (north, east), shape.edges(), margin, law)
    return velocity, _shortened(away.total(), max(0.0, parameters["AVOID_BACKUP_SPD"]))


def _backed(velocity: Level, retreat: Level) -> Level:
    """Return a velocity that backs away at least as fast as *retreat*, axis by axis."""

    def axis(wanted: float, back: float) -> float:
        return wanted if back == 0.0 else max(wanted, back) if back > 0.0 else min(wanted, back)

    return axis(velocity[0], retreat[0]), axis(velocity[1], retreat[1])


def _with_limited_change(vehicle: AutopilotVehicle, wanted: Vector, limited: Vector) -> Vector:
    """Return *limited*, which changes by AVOID_ACCEL_MAX at most from the velocity before it."""
    state, now = avoidance_of(vehicle), vehicle.kernel.now()
    if limited == wanted:
        return limited
    passed = now - state.limited_at
    before = wanted if passed > RESTART else state.velocity
    change = tuple(new - old for new, old in zip(limited, before, strict=True))
    most = vehicle.parameters["AVOID_ACCEL_MAX"] * to_seconds(min(passed, RESTART))
    size = hypot(*change)
    if vehicle.parameters["AVOID_ACCEL_MAX"] > 0.0 and size > most:
        limited = (
            before[0] + change[0] * most / size,
            before[1] + change[1] * most / size,
            before[2] + change[2] * most / size,
        )
    state.velocity, state.limited_at = limited, now
    return limited


# -- a copter

TOO_CLOSE = 0.6
"""Distance of an obstacle up to which a copter is not armed [m]."""


def obstacle_problems(vehicle: AutopilotVehicle) -> list[str]:
    """Return the text that refuses arming beside an obstacle, if there is one."""
    nearest = closest(vehicle) if _uses_proximity(vehicle) else None
    if nearest is None or nearest[0] > TOO_CLOSE:
        return []
    return [f"Proximity {int(nearest[1])} deg, {nearest[0]:4.2f}m (want > {TOO_CLOSE:0.1f}m)"]


LIMITED = (Control.CLIMB, Control.VELOCITY, Control.POSITION_CLIMB)


def _limited_climb(vehicle: AutopilotVehicle, climb: float, law: StoppingLaw) -> float:
    """Return a climb rate [m/s] within the ceiling and the distance above; beyond them the vehicle sinks."""
    if climb <= 0.0 or vehicle.manoeuvre.taking_off:
        return climb
    parameters, left = vehicle.parameters, inf
    if _uses_fence(vehicle) and round(parameters["FENCE_TYPE"]) & CEILING:
        left = parameters["FENCE_ALT_MAX"] - _fence_margin(vehicle) - vehicle.height
    above = upward(vehicle) if _uses_proximity(vehicle) else None
    if above is not None:
        left = min(left, above - parameters["AVOID_MARGIN"])
    if left > 0.0:
        return min(climb, law.speed(left))
    return -min(law.speed(-left), max(0.0, parameters["AVOID_BACKZ_SPD"]))


def _leaning_away(vehicle: AutopilotVehicle, setpoint: Setpoint) -> Setpoint:
    """Return a set-point of ALT_HOLD with the lean away from obstacles within AVOID_DIST_MAX."""
    parameters, sensor = vehicle.parameters, proximity_of(vehicle)
    most, reach = radians(parameters["AVOID_ANGLE_MAX"] / 100.0), parameters["AVOID_DIST_MAX"]
    largest = vehicle.tuning.tilt
    if most <= 0.0 or reach <= 0.0 or not _uses_proximity(vehicle):
        return setpoint
    rolls, pitches = [0.0], [0.0]
    for direction in sensor.distances:
        angle = radians(sensor.angles[direction])
        share = max(0.0, 1.0 - sensor.filtered[direction] / reach)
        rolls.append(-sin(angle) * share)
        pitches.append(cos(angle) * share)
    lean = (radians(45.0) * (max(rolls) + min(rolls)), radians(45.0) * (max(pitches) + min(pitches)))
    lean = _shortened(lean, min(most, 0.75 * largest))
    if lean == (0.0, 0.0):
        return setpoint
    roll, pitch = _shortened((setpoint.roll + lean[0], setpoint.pitch + lean[1]), largest)
    return replace(setpoint, roll=roll, pitch=pitch)


def limit_copter(vehicle: AutopilotVehicle, setpoint: Setpoint) -> Setpoint:
    """Return a copter's set-point as avoidance limits it."""
    if setpoint.control not in LIMITED or not vehicle.parameters["AVOID_ENABLE"]:
        return setpoint
    law = StoppingLaw(GAIN, BRAKE, vehicle.parameters["AVOID_BEHAVE"] == 1.0)
    if setpoint.control is Control.CLIMB:
        setpoint = _leaning_away(vehicle, setpoint) if vehicle.mode.name == "ALT_HOLD" else setpoint
        climb = _limited_climb(vehicle, setpoint.climb, law)
        return setpoint if climb == setpoint.climb else replace(setpoint, climb=climb)
    wanted = setpoint.velocity
    down = -_limited_climb(vehicle, -wanted[2], law)
    level = (wanted[0], wanted[1])
    if vehicle.mode.name in build_of(vehicle).avoiding:
        level, retreat = _limited_level(vehicle, level, law)
        level = _backed(level, retreat)
    limited = (*level, down)
    if limited == wanted:
        return setpoint
    limited = _with_limited_change(vehicle, wanted, limited)
    if setpoint.control is Control.POSITION_CLIMB and level == (wanted[0], wanted[1]):
        return replace(setpoint, climb=-limited[2])
    return replace(setpoint, control=Control.VELOCITY, velocity=limited, climb=-limited[2])


# -- a rover


def limit_rover(vehicle: AutopilotVehicle, setpoint: Setpoint) -> Setpoint:
    """Return a rover's set-point as avoidance limits it."""
    if setpoint.control not in (Control.DRIVE, Control.POSITION) or not vehicle.parameters["AVOID_ENABLE"]:
        return setpoint
    drives = setpoint.control is Control.DRIVE
    speed = setpoint.velocity[0] if drives else setpoint.speed
    heading = vehicle.estimate.attitude[2]
    wanted = turn_clockwise((speed, 0.0), heading)
    law = StoppingLaw(0.0, min(BRAKE, 0.5 * vehicle.tuning.accel), vehicle.parameters["AVOID_BEHAVE"] == 1.0)
    level, retreat = _limited_level(vehicle, wanted, law)
    level = _backed(level, retreat)
    if level == wanted:
        return setpoint
    north, east, _ = _with_limited_change(vehicle, (*wanted, 0.0), (*level, 0.0))
    limited = hypot(north, east)
    if retreat != (0.0, 0.0):
        off = abs((atan2(east, north) - heading + pi) % (2.0 * pi) - pi)
        limited = -limited if off > pi / 2.0 else limited
    elif speed < 0.0:
        limited = -limited
    if not drives and limited >= 0.0:
        return replace(setpoint, speed=limited)
    return replace(setpoint, control=Control.DRIVE, velocity=(limited, 0.0, 0.0))


def _switch_proximity(vehicle: AutopilotVehicle, position: int) -> None:
    if position:
        avoidance_of(vehicle).by_proximity = position > 0


ROVER = Feature(
    parameters={
        "AVOID_ACCEL_MAX": ("m/s²", "largest change of the velocity by avoidance; 0: any"),
        "AVOID_BACKUP_DZ": (
            "m",
            "distance within AVOID_MARGIN at which the vehicle backs away from an obstacle",
        ),
        "AVOID_BACKUP_SPD": ("m/s", "largest speed of backing away"),
        "AVOID_BEHAVE": ("", "1 shortens the velocity before a limit, 0 slides along it"),
        "AVOID_ENABLE": ("", "bits: 1 avoids the fence, 2 obstacles by the proximity sensor"),
        "AVOID_MARGIN": ("m", "distance that avoidance keeps from obstacles"),
    },
    switches={PROXIMITY_SWITCH: _switch_proximity},
    at_once=(PROXIMITY_SWITCH,),
    limit=limit_rover,
)
COPTER = replace(
    ROVER,
    parameters={
        **ROVER.parameters,
        "AVOID_ALT_MIN": ("m", "height by the rangefinder below which obstacles do not count"),
        "AVOID_ANGLE_MAX": ("0.01°", "largest lean away from obstacles in ALT_HOLD"),
        "AVOID_BACKZ_SPD": ("m/s", "largest rate of sinking back below the ceiling"),
        "AVOID_DIST_MAX": ("m", "distance of obstacles from which ALT_HOLD leans away"),
    },
    problems=obstacle_problems,
    limit=limit_copter,
)
