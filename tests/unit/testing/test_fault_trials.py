"""How a fault trial reads a touch-down from the true states of a flight."""

from __future__ import annotations

from math import cos, radians, sin

import pytest

from volery.testing.fault_trials import lean, touch_down
from volery.trace.events import VehicleState


def state(height: float, sink: float = 0.0, roll_deg: float = 0.0, x: float = 0.0) -> VehicleState:
    half = radians(roll_deg) / 2.0
    attitude = (cos(half), sin(half), 0.0, 0.0)
    estimate = (0.0, 0.0, height, 0.5, 12.0, 10.0)
    return VehicleState(0, "drone", x, 0.0, height, *attitude, 0.0, 0.0, -sink, *estimate, True, "LAND")


def test_the_lean_is_the_angle_to_the_plumb_line() -> None:
    assert lean(state(1.0, roll_deg=30.0)) == pytest.approx(30.0)
    assert lean(state(1.0, roll_deg=180.0)) == pytest.approx(180.0)


def test_the_last_metre_before_the_last_touch_down_counts() -> None:
    flight = [
        state(0.1),
        state(3.0, 4.0, 40.0),
        state(1.0, 0.8, 5.0),
        state(0.5, 0.6, 9.0, 3.0),
        state(0.1, 0.1, 20.0, 4.0),
        state(0.1),
    ]
    landing = touch_down(flight)
    assert landing is not None
    assert (landing.sink_m_s, landing.away_m, landing.battery) == (0.8, 4.0, 0.5)
    assert landing.lean_deg == pytest.approx(9.0)


def test_a_fast_fall_has_no_sample_on_the_last_metre_and_counts_all_the_same() -> None:
    landing = touch_down([state(4.0, 9.0), state(2.0, 10.0), state(0.1)])
    assert landing is not None
    assert landing.sink_m_s == 10.0


def test_a_vehicle_that_stays_on_the_ground_has_no_touch_down() -> None:
    assert touch_down([state(0.1), state(0.12), state(0.1)]) is None
