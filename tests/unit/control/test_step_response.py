"""Figures of step responses against closed forms and against python-control."""

from math import exp, log, pi, sqrt

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.errors import UsageError
from volery.control.step_response import Signal, make_signal, step_responses

TIMES = np.arange(0.0, 20.0, 0.01)


def one_step(values, goal=1.0, unit="m", period=None, at=2.0):
    """Return a signal that stands at 0 until *at* and then is *values* of the time since."""
    since = np.maximum(TIMES - at, 0.0)
    return Signal("x", unit, TIMES, values(since), np.where(at <= TIMES, goal, 0.0), period)


def response_of(signal, least=None):
    (only,) = step_responses(signal, least)
    return only


def test_a_first_order_lag_has_its_known_figures():
    found = response_of(one_step(lambda t: 1.0 - np.exp(-t / 0.5)))
    assert found.start == pytest.approx(2.0)
    assert found.delay == pytest.approx(-0.5 * log(0.95), abs=0.01)
    assert found.rise == pytest.approx(0.5 * log(9.0), abs=0.01)
    assert found.settled_10 == pytest.approx(0.5 * log(10.0), abs=0.02)
    assert found.settled_3 == pytest.approx(-0.5 * log(0.03), abs=0.02)
    assert found.iae == pytest.approx(0.5, abs=0.01)
    assert found.itae == pytest.approx(0.25, abs=0.01)
    assert found.overshoot == 0.0
    assert found.steady_error == pytest.approx(0.0, abs=1e-6)


@given(st.floats(0.2, 0.8), st.floats(1.5, 6.0))
@settings(max_examples=25, deadline=None)
def test_overshoot_and_settling_are_those_of_python_control(damping, frequency):
    plant = control.tf([frequency**2], [1.0, 2.0 * damping * frequency, frequency**2])
    expected = control.step_info(plant, T=np.arange(0.0, 18.0, 0.005), SettlingTimeThreshold=0.1)
    _, values = control.step_response(plant, TIMES)
    shifted = one_step(lambda t: np.interp(t, TIMES, values))
    found = response_of(shifted, 0.5)
    assert 100.0 * found.overshoot_share == pytest.approx(expected["Overshoot"], abs=0.5)
    assert found.overshoot_share == pytest.approx(exp(-pi * damping / sqrt(1 - damping**2)), abs=0.01)
    assert found.rise == pytest.approx(expected["RiseTime"], abs=0.03)
    assert found.settled_10 == pytest.approx(expected["SettlingTime"], abs=0.05)


def test_a_dead_time_is_the_delay():
    found = response_of(one_step(lambda t: np.where(t > 0.7, 1.0, 0.0)))
    assert found.delay == pytest.approx(0.7, abs=0.02)


def test_an_offset_is_the_steady_error():
    found = response_of(one_step(lambda t: 0.8 * (1.0 - np.exp(-t))))
    assert found.steady_error == pytest.approx(0.2, abs=1e-3)
    assert np.isnan(found.settled_10)


@pytest.mark.parametrize(("start", "goal"), [(350.0, 80.0), (-170.0, 100.0), (10.0, 280.0)])
def test_an_angle_takes_the_shorter_way(start, goal):
    size = (goal - start + 180.0) % 360.0 - 180.0
    turned = start + size * (1.0 - np.exp(-np.maximum(TIMES - 2.0, 0.0)))
    goals = np.where(TIMES >= 2.0, goal, start)
    found = response_of(Signal("yaw", "deg", TIMES, (turned + 180.0) % 360.0 - 180.0, goals, 360.0))
    assert found.size == pytest.approx(size, abs=1e-6)
    assert found.settled_10 == pytest.approx(log(10.0), abs=0.02)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_half_a_turn_may_take_either_direction(direction):
    turned = direction * 180.0 * (1.0 - np.exp(-np.maximum(TIMES - 2.0, 0.0)))
    signal = Signal("yaw", "deg", TIMES, turned, np.where(TIMES >= 2.0, 180.0, 0.0), 360.0)
    found = response_of(signal)
    assert found.size == pytest.approx(180.0 * direction)
    assert found.overshoot == pytest.approx(0.0, abs=1e-6)


def test_a_push_after_settling_is_a_disturbance_not_an_overshoot():
    def pushed(t):
        return 90.0 * (1.0 - np.exp(-t / 0.3)) + np.where(t > 10.0, 50.0 * np.exp(-(t - 10.0) / 0.5), 0.0)

    found = response_of(one_step(pushed, 90.0, "deg"))
    assert found.pushed == pytest.approx(50.0, abs=1.0)
    assert found.recovery == pytest.approx(0.5 * log(50.0 / 9.0), abs=0.05)
    assert found.overshoot < 0.1
    assert found.settled_3 == pytest.approx(-0.3 * log(0.03), abs=0.05)


def test_each_step_has_a_row():
    goal = np.where(TIMES < 5, 0.0, np.where(TIMES < 10, 90.0, np.where(TIMES < 15, -90.0, 45.0)))
    late = np.interp(TIMES - 0.1, TIMES, goal)
    found = step_responses(Signal("yaw", "deg", TIMES, late, goal, 360.0))
    assert [round(one.size) for one in found] == [90, -180, 135]
    assert [one.start for one in found] == pytest.approx([5.0, 10.0, 15.0])


def test_a_ramped_set_point_is_one_step():
    goal = np.clip(TIMES - 5.0, 0.0, 3.0) * 30.0
    found = response_of(Signal("yaw", "deg", TIMES, goal, goal, 360.0))
    assert found.size == pytest.approx(90.0, abs=1.5)  # it begins when the ramp leaves its level


def test_without_set_points_movements_between_rests_are_steps():
    values = 10.0 * (1.0 - np.exp(-np.maximum(TIMES - 4.0, 0.0))) - 4.0 / (1 + np.exp(-(TIMES - 15.0) * 8.0))
    found = step_responses(Signal("z", "m", TIMES, values), 2.0)
    assert [one.size for one in found] == pytest.approx([10.0, -4.0], abs=0.5)


def test_set_points_hold_until_they_change():
    signal = make_signal(
        "x", "m", (np.array([0.0, 1.0, 2.0]), np.zeros(3)), (np.array([0.5]), np.array([7.0]))
    )
    assert signal.goal is not None
    assert np.isnan(signal.goal[0])
    assert signal.goal[1:].tolist() == [7.0, 7.0]


def test_disorder_and_gaps_in_a_record_are_mended():
    times = np.array([0.0, 2.0, 1.0, 1.0, np.nan, 3.0])
    signal = make_signal("x", "m", (times, np.array([0.0, 2.0, 9.0, 1.0, 5.0, np.nan])))
    assert signal.times.tolist() == [0.0, 1.0, 2.0]
    assert signal.measured.tolist() == [0.0, 1.0, 2.0]


def test_too_few_samples_and_a_wrong_size_are_refused():
    with pytest.raises(UsageError, match="2 samples"):
        step_responses(Signal("x", "m", TIMES[:2], TIMES[:2]))
    with pytest.raises(UsageError, match="above 0"):
        step_responses(Signal("x", "m", TIMES, TIMES), -1.0)
