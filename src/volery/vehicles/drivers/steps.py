"""Steps, and limits of theirs, that are the same for every autopilot."""

from __future__ import annotations

from collections.abc import Callable

from volery.base.errors import UsageError
from volery.base.time import MINUTE, Ns, S
from volery.vehicles.driver import Repeat, Step, Sticks
from volery.vehicles.telemetry import Telemetry

ANSWERED_WITHIN: Ns = 5 * S
ARMED_WITHIN: Ns = 10 * S
READY_WITHIN: Ns = 2 * MINUTE
STOPPED_WITHIN: Ns = 30 * S
TURNED_WITHIN: Ns = 30 * S
TURNED_DEG = 3.0
IDLE_THROTTLE = 0.1


def nothing() -> None:
    """Some steps only wait."""


def at_once(ask: str, action: Callable[[], None], enters: str = "") -> Step:
    """Something that is done as soon as it is sent."""
    return Step(ask=ask, send=action, done=lambda seen: True, within=ANSWERED_WITHIN, enters=enters)


def until_ready(within: Ns, advice: str, keep: Repeat | None = None) -> Step:
    """Until it could arm and go by position."""
    return Step(
        ask="be ready to arm and to go by position",
        send=nothing,
        done=lambda seen: seen.ready or seen.armed,
        within=within,
        skippable=True,
        keep=keep,
        advice=advice,
    )


def until_disarmed(ask: str, mode: str, within: Ns, leads_to: tuple[str, ...] = ()) -> Step:
    """In *mode* it comes down by itself and stops its motors."""
    return Step(
        ask=ask, send=nothing, done=lambda seen: not seen.armed, within=within, mode=mode, leads_to=leads_to
    )


def heads(degrees: float) -> Callable[[Telemetry], bool]:
    """It looks *degrees* clockwise from north."""

    def turned(seen: Telemetry) -> bool:
        off = (seen.attitude.heading - degrees + 180.0) % 360.0 - 180.0
        return abs(off) <= TURNED_DEG

    return turned


def check_not_idle(seen: Telemetry, held: Sticks | None, least: float = IDLE_THROTTLE) -> None:
    """Raise ``UsageError`` if it is to be flown by an idle throttle in the air: it would fall."""
    throttle = held.throttle if held is not None else 0.0
    if seen.flying and throttle < least:
        raise UsageError(
            f"{seen.name}: the throttle is at {throttle:g}: flown stabilized the motors would idle and it "
            f"would fall; manual_control() with a throttle about 0.5 first"
        )
