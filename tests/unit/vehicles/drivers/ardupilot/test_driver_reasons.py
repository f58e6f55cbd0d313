"""Why ArduPilot does not get ready: arming checks that stay end the wait, others do not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.errors import Refused
from volery.base.position import AboveHome, Position
from volery.base.time import S

Make = Callable[..., Any]
RUN_CHECKS = 401


def fails(at: Any, text: str) -> None:
    """An arming check fails, and is reported whenever the checks are run."""
    at.craft.health = 0
    at.autopilot.on_command = lambda command, _: (
        at.autopilot.text(text, 2) if command == RUN_CHECKS and at.craft.health == 0 else None
    )


@pytest.mark.parametrize(
    "text",
    [
        "PreArm: Battery 1 below minimum arming voltage",
        "PreArm: Radio failsafe on",
        "PreArm: Check FS_THR_VALUE",
    ],
)
def test_a_take_off_ends_at_once_if_waiting_does_not_mend_it(bench: Make, text: str) -> None:
    at = bench()
    fails(at, text)
    with pytest.raises(Refused, match=f"waiting does not mend: {text}"):
        at.fly(lambda drone: drone.takeoff(10))
    assert at.kernel.now() < 15 * S


def test_the_reason_of_a_mode_names_the_transmitters_switch(bench: Make) -> None:
    at = bench()
    fails(at, "PreArm: Mode requires mission")
    with pytest.raises(
        Refused, match=r"Mode requires mission .choose another mode at the transmitter's mode switch"
    ):
        at.fly(lambda drone: drone.wait_ready())


@pytest.mark.parametrize("text", ["PreArm: Need Position Estimate", "PreArm: Gyros inconsistent"])
def test_a_take_off_waits_for_what_passes(bench: Make, text: str) -> None:
    at = bench()
    fails(at, text)
    at.after(30, lambda: setattr(at.craft, "health", 0x10000000))
    at.fly(lambda drone: drone.takeoff(10))
    assert at.craft.armed


def test_a_target_that_is_not_taken_up_is_refused_in_seconds(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.take = lambda name, fields: None  # beyond its own fence: ignored without a word
        here = drone.position
        began = at.kernel.now()
        with pytest.raises(Refused, match="does not take up the target: it stands still 333 m from it"):
            drone.goto(Position(here.latitude + 0.003, here.longitude, AboveHome(10)))
        assert at.kernel.now() - began < 10 * S

    at.fly(mission)
