"""The turn that a yaw stick results in on PX4 in SIH."""

from types import SimpleNamespace
from typing import Any

import pytest

from volery.simulation.autopilots.px4.flight_modes import turn_by_stick
from volery.simulation.autopilots.px4.yaw_stick import STEP, YawStick


def test_the_turn_lags_behind_the_stick() -> None:
    """The loop closes at (0.4 * 0.2 + 0.025) / 0.03 = 3.5 rad/s, after filter and motors of 0.13 s."""
    stick = YawStick()
    assert stick.step(1.0, 0.1) < 0.12
    assert 0.35 < stick.step(1.0, 0.3) < 0.65
    assert stick.step(1.0, 10.0) == pytest.approx(1.0, abs=0.02)


def test_damping_leaves_the_turn_too_slow_until_the_integral_has_grown() -> None:
    assert YawStick().step(1.0, 1.0) == pytest.approx(0.83, abs=0.03)


def test_a_centred_stick_ends_the_turn() -> None:
    stick = YawStick()
    stick.step(1.0, 3.0)
    turned = 0.0
    for _ in range(round(8.0 / STEP)):
        turned += STEP * stick.step(0.0, STEP)
    assert 0.4 < turned < 0.5
    assert stick.rate == pytest.approx(0.0, abs=0.01)


def test_reset_ends_it_at_once() -> None:
    stick = YawStick()
    stick.step(1.0, 3.0)
    stick.reset()
    assert stick.step(0.0, 1.0) == 0.0


def test_on_the_ground_the_stick_turns_nothing() -> None:
    stick = YawStick()
    tuning = SimpleNamespace(pilot_yaw_rate=2.6)
    vehicle: Any = SimpleNamespace(landed=True, parameters={"MPC_HOLD_DZ": 0.1}, tuning=tuning)
    assert turn_by_stick(vehicle, stick, 1.0, 1.0) == 0.0
    vehicle.landed = False
    assert turn_by_stick(vehicle, stick, 1.0, 1.0) > 1.5
