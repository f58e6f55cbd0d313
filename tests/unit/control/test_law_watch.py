"""What ends a law: an error that grows, and a vehicle that does not follow; where a manoeuvre has ended."""

from __future__ import annotations

from math import nan

import pytest

from volery.control.actuation import MeasuredState, MotionCommand
from volery.control.law_watch import ErrorWatch, FollowWatch, ended_off
from volery.control.laws import PidGains, PidLaw, Terms
from volery.control.manoeuvres import LoopSample

SAMPLE_S = 0.05


def sample(loop: str, error: float, goal: float = 0.0) -> LoopSample:
    unit = "deg" if loop == "yaw" else "m"
    return LoopSample(loop, "PID", unit, 0.0, goal, goal - error, Terms(error, 0.0, 0.0, 0.0, 0.0, 0.0))


def grown(errors: list[float], loop: str = "north") -> str:
    watch = ErrorWatch({loop: PidLaw(PidGains(kp=0.9, ki=0.02))})
    return next(filter(None, (watch.check([sample(loop, one)], SAMPLE_S) for one in errors)), "")


def test_an_error_that_grows_is_named_with_its_gains() -> None:
    swing = [0.5 * (-1.0) ** (tick // 40) * 1.3 ** (tick // 40) for tick in range(600)]
    assert "of north grew from 0.5 to 6.9 m, beyond the limit of 5.5 m, under kp 0.9, ki 0.02" in grown(swing)
    assert "of yaw grew from 0.0 to 100.0 deg" in grown([0.0] + [100.0] * 40, "yaw")


def test_a_step_an_approach_and_a_jump_are_no_growth() -> None:
    assert grown([100.0 - tick for tick in range(100)] + [-4.9] * 40) == ""
    assert grown([0.0] * 20 + [80.0] * 19 + [0.0] * 20) == ""  # back within a second
    assert grown([0.0] + [nan] * 100) == ""
    watch = ErrorWatch({})
    assert watch.check([sample("north", 0.1)], SAMPLE_S) == ""
    assert all(watch.check([sample("north", 50.0, goal=50.0)], SAMPLE_S) == "" for _ in range(100))


def followed(
    command: MotionCommand,
    share: float,
    seconds: float = 12.0,
    north: float | None = None,
    climbs: float = 0.0,
) -> str:
    """Return what the watch says of a vehicle that does a *share* of what it is commanded.

    By its own velocity it *climbs*, m/s.
    """
    watch, place = FollowWatch(), [0.0] * 4
    for _ in range(round(seconds / SAMPLE_S)):
        measured = MeasuredState(
            place[3] % 360.0, place[0] if north is None else north, *place[1:3], 0.0, 0.0, climbs
        )
        wrong = watch.check(command, measured, SAMPLE_S)
        if wrong:
            return wrong
        place = [here + share * speed * SAMPLE_S for here, speed in zip(place, command, strict=True)]
    return ""


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (MotionCommand(north=3.0), "14.9 m north were asked for within 5 s, 0.0 m came"),
        (MotionCommand(up=-0.8), "-2.0 m up were asked for within 2.5 s, 0.0 m came"),
        (MotionCommand(yaw_rate=90.0), "225.0 deg turn were asked for"),
    ],
)
def test_a_command_without_effect_is_told(command: MotionCommand, said: str) -> None:
    assert said in followed(command, 0.0)
    assert followed(command, 0.5) == ""
    assert followed(command, 0.0, seconds=4.0) == ""


def test_an_estimate_whose_height_and_climb_disagree_is_not_judged() -> None:
    """A PX4 1.15 in SIH that sank at 0.4 m/s by its velocity was landed, because its height rose."""
    assert followed(MotionCommand(up=-0.45), -0.1, climbs=-0.4) == ""
    assert "does not follow" in followed(MotionCommand(up=-0.45), -0.1, climbs=0.0)


def test_small_commands_and_lost_positions_are_not_judged() -> None:
    assert followed(MotionCommand(north=1.0, yaw_rate=5.0), 0.0) == ""
    assert followed(MotionCommand(north=3.0), 0.0, north=nan) == ""


def test_where_a_manoeuvre_ends_is_judged_by_its_last_errors() -> None:
    assert ended_off([sample("north", 0.6), sample("altitude", 0.7), sample("yaw", 9.0)], 1.0) == ""
    assert ended_off([sample("north", 0.8), sample("east", 0.8)], 1.0).startswith("1.1 m from its set-point")
    assert ended_off([sample("yaw", -12.0)], 1.0).startswith("12 degrees from its set-point")
    assert "nan m" in ended_off([sample("north", nan)], 1.0)
