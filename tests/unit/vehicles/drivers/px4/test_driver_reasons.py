"""Why PX4 refuses, for a program that connects late and for one that waits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.errors import Refused
from volery.base.time import S
from volery.kernel.waiting import sleep
from volery.vehicles.drivers.px4.events import ALL_MODES, event_id
from volery.vehicles.drivers.px4.modes import HOLD, MODES

Make = Callable[..., Any]
INFO, ERROR = 6, 3
RUN_CHECKS = 401
HOLD_BIT = 1 << MODES[HOLD].state


def keep_report(at: Any, *checks: tuple[str, int, int]) -> None:
    """The report was sent before the program connected; it is sent again to who asks for these events."""
    kept: dict[int, dict[str, Any]] = {}
    report = [("commander_arming_check_summary", 8, 0), *checks, ("commander_health_summary", 8, 0)]
    for sequence, (name, level, modes) in enumerate(report, 100):
        arguments = tuple(modes.to_bytes(4, "little").ljust(40, b"\0"))
        kept[sequence] = {
            "id": event_id(name),
            "sequence": sequence,
            "log_levels": level | level << 4,
            "arguments": arguments,
        }
    take, latest = at.autopilot.take, max(kept)

    def answer(name: str, fields: dict[str, Any]) -> None:
        if name == "REQUEST_EVENT":
            for sequence in range(fields["first_sequence"], fields["last_sequence"] + 1):
                if sequence in kept:
                    at.autopilot.say("EVENT", **kept[sequence])
        take(name, fields)

    at.autopilot.take = answer
    at.kernel.every(S, lambda: at.autopilot.say("CURRENT_EVENT_SEQUENCE", sequence=latest))


@pytest.mark.parametrize(
    ("check", "says"),
    [
        (("check_modes_global_pos", ERROR, HOLD_BIT), "no valid global position estimate"),
        (("check_modes_mission", INFO, ALL_MODES), "no valid mission available"),
    ],
)
def test_a_late_program_learns_why_arming_is_refused(
    bench: Make, check: tuple[str, int, int], says: str
) -> None:
    at = bench()
    at.craft.healthy = False
    keep_report(at, ("check_rc_dl_no_dllink", 4, 0), check)

    def mission(drone: Any) -> None:
        drone.wait_connected()
        sleep(at.kernel, 3 * S)
        drone.arm()

    with pytest.raises(Refused, match=says):
        at.fly(mission)
    assert len(at.autopilot.sent("REQUEST_EVENT")) == 1


def test_without_a_report_the_checks_are_run_and_their_reason_is_told(bench: Make) -> None:
    at = bench()
    at.craft.healthy = False
    obey = at.autopilot.obey

    def obey_checks(command: int, fields: dict[str, Any]) -> None:
        if command == RUN_CHECKS:
            at.autopilot.report(("check_battery_low", ERROR, ALL_MODES))
        obey(command, fields)

    at.autopilot.obey = obey_checks
    with pytest.raises(Refused, match="low battery"):
        at.fly(lambda drone: drone.arm())


def test_a_take_off_ends_at_once_if_waiting_does_not_mend_it(bench: Make) -> None:
    at = bench()
    at.craft.healthy = False
    keep_report(at, ("check_modes_mission", INFO, ALL_MODES))
    with pytest.raises(Refused, match="waiting does not mend: no valid mission available"):
        at.fly(lambda drone: drone.takeoff(10))
    assert at.kernel.now() < 15 * S


def test_a_take_off_waits_for_what_passes(bench: Make) -> None:
    at = bench()
    at.craft.healthy = False
    keep_report(at, ("check_modes_global_pos", ERROR, HOLD_BIT))
    at.after(30, lambda: setattr(at.craft, "healthy", True))
    at.fly(lambda drone: drone.takeoff(10))
    assert at.craft.armed
