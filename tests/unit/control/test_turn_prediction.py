"""What is still to come of a turn, against the closed form of the modelled loops."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.control.turn_prediction import TurnModel, TurnPrediction

MODEL = TurnModel(acceleration=1e9, delay_s=0.1, frequency=5.0, damping=0.3)


def test_without_a_model_nothing_is_to_come() -> None:
    prediction = TurnPrediction(None)
    prediction.command(90.0, 0.05)
    assert prediction.lead == 0.0


def test_a_steady_turn_is_late_by_the_delay_only() -> None:
    """The loops follow a ramp of the target without an error, after the swing has died down."""
    prediction = TurnPrediction(MODEL)
    for _ in range(200):
        prediction.command(10.0, 0.05)
    assert prediction.lead == pytest.approx(10.0 * MODEL.delay_s, rel=0.02)


def test_the_swing_is_that_of_a_second_order_system() -> None:
    """The error of the target starts with the slope of its rate, and is a damped sine."""
    prediction = TurnPrediction(MODEL._replace(delay_s=0.0))
    omega = MODEL.frequency * math.sqrt(1.0 - MODEL.damping**2)
    for number in range(1, 60):
        prediction.command(10.0, 0.02)
        t = 0.02 * number
        expected = 10.0 / omega * math.exp(-MODEL.damping * MODEL.frequency * t) * math.sin(omega * t)
        assert prediction.lead == pytest.approx(expected, abs=0.12)


def test_the_acceleration_is_limited() -> None:
    slow = TurnPrediction(MODEL._replace(acceleration=100.0))
    slow.command(50.0, 0.1)
    assert slow.lead == pytest.approx(0.5 * 100.0 * 0.1**2, rel=0.15)


@given(st.lists(st.floats(-200.0, 200.0), max_size=60))
def test_at_rest_nothing_is_to_come(rates: list[float]) -> None:
    prediction = TurnPrediction(MODEL._replace(acceleration=270.0))
    for rate in rates:
        prediction.command(rate, 0.05)
    for _ in range(160):
        prediction.command(0.0, 0.05)
    assert abs(prediction.lead) < 0.05
    prediction.command(100.0, 0.05)
    prediction.reset()
    assert prediction.lead == 0.0
