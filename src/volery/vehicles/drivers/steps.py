"""Steps, and limits of theirs, that are the same for every autopilot.

When a vehicle counts as having arrived: near its goal, and nearly standing.
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, inf, isnan

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.position import AboveHome, Position
from volery.base.time import MINUTE, Ns, S
from volery.vehicles.driver import ManualControl, Repeat, Step
from volery.vehicles.telemetry import Telemetry

ANSWERED_WITHIN: Ns = 5 * S
ARMED_WITHIN: Ns = 10 * S
READY_WITHIN: Ns = 2 * MINUTE
STOPPED_WITHIN: Ns = 30 * S
TURNED_WITHIN: Ns = 30 * S
TURNED_DEG = 3.0
IDLE_THROTTLE = 0.1


def send_nothing() -> None:
    """Some steps only wait."""


def immediate_step(ask: str, action: Callable[[], None], enters: str = "") -> Step:
    """Something that is done as soon as it is sent."""
    return Step(ask=ask, send=action, done=lambda seen: True, within=ANSWERED_WITHIN, enters=enters)


def ready_step(within: Ns, advice: str, keep: Repeat | None = None) -> Step:
    """Until it could arm and go by position."""
    return Step(
        ask="be ready to arm and to go by position",
        send=send_nothing,
        done=lambda seen: seen.ready or seen.armed,
        within=within,
        skippable=True,
        keep=keep,
        advice=advice,
    )


def disarmed_step(ask: str, mode: str, within: Ns, leads_to: tuple[str, ...] = ()) -> Step:
    """In *mode* it comes down by itself and stops its motors."""
    return Step(
        ask=ask,
        send=send_nothing,
        done=lambda seen: not seen.armed,
        within=within,
        mode=mode,
        leads_to=leads_to,
    )


def heading_reached(degrees: float) -> Callable[[Telemetry], bool]:
    """It looks *degrees* clockwise from north."""

    def turned(seen: Telemetry) -> bool:
        off = (seen.attitude.heading - degrees + 180.0) % 360.0 - 180.0
        return abs(off) <= TURNED_DEG

    return turned


def check_throttle(seen: Telemetry, held: ManualControl | None, least: float = IDLE_THROTTLE) -> None:
    """Raise ``UsageError`` if it is to be flown by an idle throttle in the air: it would fall."""
    throttle = held.throttle if held is not None else 0.0
    if seen.flying and throttle < least:
        raise UsageError(
            f"{seen.name}: the throttle is at {throttle:g}: flown stabilized the motors would idle and it "
            f"would fall; manual_control() with a throttle about 0.5 first"
        )


DRONE_KIND, ROVER_KIND = "drone", "rover"
"""What ``Telemetry.kind`` says."""

NEAR_M, NEAR_UP_M = 0.6, 0.3
"""A drone, horizontally and vertically."""
STANDING_M_S = 0.5
ROVER_NEAR_M = 2.5
"""Rovers stop within their waypoint radius of a goal: 2 m in ArduRover (WP_RADIUS) and PX4 (NAV_ACC_RAD)."""
ROVER_STANDING_M_S = 0.3


def at_rest(seen: Telemetry) -> bool:
    """It hardly moves any more."""
    limit = STANDING_M_S if seen.kind == DRONE_KIND else ROVER_STANDING_M_S
    return hypot(seen.velocity.north, seen.velocity.east) <= limit and not abs(seen.velocity.up) > limit


def arrived_at(goal: Position, rover: bool) -> Callable[[Telemetry], bool]:
    """Near *goal* and nearly standing."""
    frame = LocalFrame(goal.latitude, goal.longitude, 0.0)
    near = ROVER_NEAR_M if rover else NEAR_M

    def arrived(seen: Telemetry) -> bool:
        if seen.position is None or not at_rest(seen):
            return False
        east, north, _ = frame.to_enu(seen.position.latitude, seen.position.longitude, 0.0)
        return hypot(east, north) <= near and (rover or _up_off(seen, goal) <= NEAR_UP_M)

    return arrived


def _up_off(seen: Telemetry, goal: Position) -> float:
    """Metres above or below the goal; 0 for kinds of altitude that telemetry does not tell."""
    if seen.position is None or isnan(seen.above_home):
        return 0.0
    if isinstance(goal.altitude, AboveHome):
        return abs(seen.above_home - goal.altitude.metres)
    return abs(seen.position.altitude.metres - goal.altitude.metres)


def horizontal_distance(here: Position | None, there: Position) -> float:
    """Horizontal metres; infinite from nowhere."""
    if here is None:
        return inf
    east, north, _ = LocalFrame(there.latitude, there.longitude, 0.0).to_enu(
        here.latitude, here.longitude, 0.0
    )
    return hypot(east, north)


def climbed_to(height: float) -> Callable[[Telemetry], bool]:
    """In the air, *height* metres above home, and no longer going up or down."""

    def up(seen: Telemetry) -> bool:
        near = abs(seen.above_home - height) <= NEAR_UP_M
        return seen.flying and near and abs(seen.velocity.up) <= STANDING_M_S

    return up
