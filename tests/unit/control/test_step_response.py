"""Figures of step responses against closed forms and against python-control."""

from math import exp, log, pi, sqrt

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.errors import UsageError
from volery.control.step_response import (
    ControlledSignal,
    GroundedStretch,
    judged,
    make_signal,
    step_responses,
)

TIMES = np.arange(0.0, 20.0, 0.01)


def one_step(values, goal=1.0, unit="m", period=None, at=2.0):
    """Return a signal that stands at 0 until *at* and then is *values* of the time since."""
    since = np.maximum(TIMES - at, 0.0)
    return ControlledSignal("x", unit, TIMES, values(since), np.where(at <= TIMES, goal, 0.0), period)


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
    found = response_of(ControlledSignal("yaw", "deg", TIMES, (turned + 180.0) % 360.0 - 180.0, goals, 360.0))
    assert found.size == pytest.approx(size, abs=1e-6)
    assert found.settled_10 == pytest.approx(log(10.0), abs=0.02)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_half_a_turn_may_take_either_direction(direction):
    turned = direction * 180.0 * (1.0 - np.exp(-np.maximum(TIMES - 2.0, 0.0)))
    signal = ControlledSignal("yaw", "deg", TIMES, turned, np.where(TIMES >= 2.0, 180.0, 0.0), 360.0)
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
    found = step_responses(ControlledSignal("yaw", "deg", TIMES, late, goal, 360.0))
    assert [round(one.size) for one in found] == [90, -180, 135]
    assert [one.start for one in found] == pytest.approx([5.0, 10.0, 15.0])


def test_a_ramp_is_judged_from_its_end_and_is_no_step():
    goal = np.clip(TIMES - 5.0, 0.0, 3.0) * 30.0
    late = np.interp(TIMES - 0.2, TIMES, goal)
    found = response_of(ControlledSignal("yaw", "deg", TIMES, late, goal, 360.0))
    assert (found.start, found.ramp) == pytest.approx((8.0, 3.0), abs=0.1)
    assert found.size == pytest.approx(90.0, abs=0.5)
    assert np.isnan([found.delay, found.rise]).all()
    assert found.overshoot == pytest.approx(0.0, abs=1e-6)
    assert found.settled_3 == pytest.approx(0.11, abs=0.06)  # 0.2 s late, less 3 % of 90 degrees at 30 deg/s


def test_without_set_points_movements_between_rests_are_steps():
    values = 10.0 * (1.0 - np.exp(-np.maximum(TIMES - 4.0, 0.0))) - 4.0 / (1 + np.exp(-(TIMES - 15.0) * 8.0))
    found = step_responses(ControlledSignal("z", "m", TIMES, values), 2.0)
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
        step_responses(ControlledSignal("x", "m", TIMES[:2], TIMES[:2]))
    with pytest.raises(UsageError, match="above 0"):
        step_responses(ControlledSignal("x", "m", TIMES, TIMES), -1.0)


def reasons(signal):
    """Return why each change of the set-point is not judged, where nothing is."""
    found = judged(signal)
    assert found.responses == []
    return [one.why for one in found.not_judged]


def following(goal, lag=0.3, **more):
    """Return a signal whose measurement follows *goal* as a lag of first order."""
    values = np.zeros_like(goal)
    for index in range(1, len(goal)):
        values[index] = values[index - 1] + (goal[index - 1] - values[index - 1]) * 0.01 / lag
    return ControlledSignal("roll", "deg", TIMES, values, goal, 360.0, **more)


def test_an_oscillation_that_passes_through_the_band_is_not_settled():
    swing = one_step(lambda t: 90.0 + 30.0 * np.sin(1.3 * t) - 90.0 * (t == 0.0), 90.0, "deg")
    for length in range(900, len(TIMES), 37):  # wherever the record ends
        found = response_of(
            ControlledSignal("x", "deg", TIMES[:length], swing.measured[:length], swing.goal[:length])
        )
        assert np.isnan([found.settled_10, found.settled_3]).all()


def test_what_enters_the_band_at_the_end_of_the_record_is_not_settled():
    assert np.isnan(response_of(one_step(lambda t: np.where(t > 17.5, 1.0, 0.0))).settled_10)
    assert response_of(one_step(lambda t: np.where(t > 16.5, 1.0, 0.0))).settled_10 == pytest.approx(
        16.5, abs=0.02
    )


def test_an_oscillation_that_dies_is_settled():
    found = response_of(one_step(lambda t: 1.0 - np.exp(-0.5 * t) * np.cos(4.0 * t)))
    assert found.settled_10 == pytest.approx(log(10.0) / 0.5, abs=0.8)


@pytest.mark.parametrize("hold", [1.2, 1.9])
def test_stick_pulses_are_not_judged(hold):
    goal = np.where((TIMES >= 5.0) & (5.0 + hold > TIMES), -15.0, 0.0)
    goal = np.where((5.0 + hold <= TIMES) & (5.0 + 2 * hold > TIMES), 15.0, goal)
    slow = following(goal, lag=1.2)
    found = judged(slow)
    assert [one.why for one in found.not_judged] == ["a pulse: it is held for less than 2 s"] * 2
    assert [round(one.start, 1) for one in found.responses] == [5.0 + 2 * hold]  # back to 0, held


def test_a_short_hold_in_which_it_settles_is_judged():
    goal = np.where((TIMES >= 5.0) & (TIMES < 6.8), 20.0, 0.0)
    assert [round(one.size) for one in step_responses(following(goal, lag=0.1))] == [20, -20]


def test_a_set_point_that_goes_up_and_comes_back_is_not_a_step():
    goal = np.interp(TIMES, [5.0, 8.0, 13.0], [0.0, 20.0, -6.0])
    assert reasons(following(goal)) == ["it moves to and fro before it stands"]


def test_a_set_point_that_never_stands_is_not_judged():
    assert reasons(following(15.0 * np.sin(TIMES))) == ["it never stands for 1 s"]


def test_disarmed_and_landed_stretches_are_not_judged():
    goal = np.where(TIMES < 4.0, 0.0, np.where(TIMES < 10.0, 30.0, np.where(TIMES < 15.0, -30.0, 60.0)))
    idle = (GroundedStretch(-np.inf, 6.0, "disarmed"), GroundedStretch(15.5, np.inf, "on the ground"))
    found = judged(following(goal, idle=idle))
    assert [(round(one.start), round(one.end)) for one in found.responses] == [(10, 15)]
    assert [one.why for one in found.not_judged] == [
        "the vehicle is disarmed",
        "the vehicle is on the ground less than 2 s later",
    ]


def test_a_response_ends_when_the_vehicle_lands():
    goal = np.where(TIMES < 4.0, 0.0, 30.0)
    (found,) = step_responses(following(goal, idle=(GroundedStretch(12.0, np.inf, "on the ground"),)))
    assert found.end == pytest.approx(12.0)


def test_the_set_point_at_the_beginning_is_a_step_only_where_a_controller_takes_over():
    goal = np.full_like(TIMES, 30.0)
    assert [round(one.size) for one in step_responses(following(goal))] == [30]
    assert reasons(following(goal, engaged=False)) == ["it is there when the record begins"]


def test_a_gap_in_the_record_is_no_ramp():
    keep = (TIMES < 5.0) | (TIMES > 9.0)
    goal = np.where(TIMES < 7.0, 0.0, 30.0)
    whole = following(goal)
    assert reasons(ControlledSignal("x", "deg", TIMES[keep], whole.measured[keep], goal[keep], 360.0)) == [
        "the record has a gap there"
    ]


def test_a_step_is_dated_when_it_was_sent_or_else_by_its_report_with_the_resolution():
    reports = np.arange(0.1, 20.0, 0.25)
    value = following(np.where(TIMES >= 5.0, 90.0, 0.0), lag=0.5)
    aims = np.where(reports >= 5.0, 90.0, 0.0)
    late = make_signal("yaw", "deg", (TIMES, value.measured), (reports, aims), period=360.0)
    (found,) = step_responses(late)
    assert (found.start, found.resolution) == pytest.approx((5.1, 0.25))
    exact = ControlledSignal(**{**vars(late), "sent": [1.0, 5.0, 9.0]})
    (found,) = step_responses(exact)
    assert (found.start, found.resolution) == (5.0, 0.0)
    assert found.settled_10 == pytest.approx(0.5 * log(10.0), abs=0.02)


def test_a_jump_without_a_set_point_is_a_step():
    found = step_responses(
        ControlledSignal("roll", "deg", TIMES, np.where(TIMES < 6.0, 0.0, 10.0), None, 360.0)
    )
    assert [(round(one.start), round(one.size)) for one in found] == [(6, 10)]
