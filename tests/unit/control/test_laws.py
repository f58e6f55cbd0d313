"""Properties of the control laws against closed forms and against python-control."""

from math import exp, inf, isclose, nan, sqrt

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.errors import UsageError
from volery.control.laws import (
    PID_START,
    CascadeState,
    OnOffGains,
    OnOffLaw,
    PidGains,
    PidLaw,
    cascade,
    on_off,
    per_sample,
    pid,
    take_over,
    wrap,
)

gains_of = st.floats(0.0, 20.0)
values = st.floats(-500.0, 500.0)
samples = st.floats(0.005, 0.5)


def response(gains: PidGains, plant: "control.StateSpace", goal: float, sample_s: float, steps: int) -> list:
    """Return the output of a discrete *plant* under the law."""
    a, b, c = plant.A, plant.B, plant.C
    x, state, measured = np.zeros((a.shape[0], 1)), PID_START, []
    for _ in range(steps):
        y = float((c @ x)[0, 0])
        measured.append(y)
        terms, state = pid(gains, state, goal, y, sample_s)
        x = a @ x + b * terms.output
    return measured


# -- closed forms


@given(kp=gains_of, ki=gains_of, error=values, sample_s=samples, steps=st.integers(1, 40))
def test_a_constant_error_gives_the_line_of_a_pi_law(kp, ki, error, sample_s, steps):
    state = PID_START
    for _ in range(steps):
        terms, state = pid(PidGains(kp=kp, ki=ki), state, error, 0.0, sample_s)
    expected = kp * error + ki * error * sample_s * steps
    assert isclose(terms.output, expected, rel_tol=1e-9, abs_tol=1e-6)


@given(kd=gains_of, slope=st.floats(-50, 50), sample_s=samples)
def test_the_derivative_of_a_ramp_is_its_slope(kd, slope, sample_s):
    state = PID_START
    for step in range(5):
        terms, state = pid(PidGains(kd=kd), state, 0.0, slope * step * sample_s, sample_s)
    assert isclose(terms.output, -kd * slope, rel_tol=1e-6, abs_tol=1e-6)


def test_the_filter_of_the_derivative_is_a_first_order_lag():
    sample_s, tau = 0.001, 0.2
    state = PID_START
    for step in range(201):  # a ramp of slope 1 that begins at 0
        terms, state = pid(PidGains(kd=1.0, filter_s=tau), state, 0.0, -step * sample_s, sample_s)
    assert terms.derivative == pytest.approx(1.0 - exp(-0.2 / tau), abs=0.005)


@pytest.mark.parametrize(
    ("kp", "ki", "kd", "filter_s"), [(2.0, 0.0, 0.0, 0.0), (2.0, 1.0, 0.0, 0.0), (4.0, 1.5, 0.8, 0.1)]
)
def test_a_closed_loop_is_that_of_python_control(kp, ki, kd, filter_s):
    sample_s, steps = 0.02, 300
    plant = control.c2d(control.ss(control.tf([1.0], [1.0, 1.0, 0.0])), sample_s, "zoh")
    z = control.tf([1.0, 0.0], [1.0], sample_s)
    backward = (z - 1) / (sample_s * z)
    law = kp + ki / backward + kd * backward / (filter_s * backward + 1)
    loop = control.feedback(law * control.tf(plant), 1)
    _, expected = control.step_response(
        control.minreal(loop, 1e-6, verbose=False), np.arange(steps) * sample_s
    )
    # with the derivative of the error the difference of the first sample is that from 0
    gains = PidGains(kp=kp, ki=ki, kd=kd, filter_s=filter_s, on_measurement=False)
    x, measured = np.zeros((2, 1)), []
    state = PID_START._replace(error=0.0, measurement=0.0)
    for _ in range(steps):
        y = float((plant.C @ x)[0, 0])
        measured.append(y)
        terms, state = pid(gains, state, 1.0, y, sample_s)
        x = plant.A @ x + plant.B * terms.output
    assert np.allclose(measured, expected, atol=1e-6)


@given(st.floats(0.5, 3.0), st.floats(0.0, 1.0))
@settings(max_examples=25)
def test_the_response_hardly_depends_on_the_sample_time(kp, ki):
    plant = control.ss(control.tf([1.0], [0.5, 1.0]))
    gains = PidGains(kp=kp, ki=ki, kd=0.05, filter_s=0.1)
    fine = response(gains, control.c2d(plant, 0.005), 1.0, 0.005, 800)[::4]
    coarse = response(gains, control.c2d(plant, 0.02), 1.0, 0.02, 200)
    assert np.max(np.abs(np.subtract(fine, coarse))) < 0.06


def test_gains_per_sample_give_the_sums_of_the_thesis():
    kp, ki, kd = per_sample(2.0, 0.1, 0.07, 0.1)
    law = PidLaw(PidGains(kp=kp, ki=ki, kd=kd, on_measurement=False))
    errors, total, last = [90.0, 80.0, 65.0], 0.0, 90.0
    for error in errors:
        total += 0.1 * error
        expected = 2.0 * error + total + 0.07 * (error - last)
        last = error
        assert law(error, 0.0, 0.1).output == pytest.approx(expected)


# -- limits and windup


@given(
    ki=st.floats(0.01, 20),
    kp=st.floats(0.0, 5.0),
    error=st.floats(1, 500),
    wound=st.integers(1, 300),
    sample_s=samples,
)
def test_the_integral_never_sticks(ki, kp, error, wound, sample_s):
    gains = PidGains(kp=kp, ki=ki, low=-10.0, high=10.0)
    state = PID_START
    for _ in range(wound):
        _, state = pid(gains, state, error, 0.0, sample_s)
    assert state.output <= 10.0
    assert state.integral <= 10.0 + 1e-9
    # the error reverses: the output leaves its limit with the next sample
    terms, _ = pid(gains, state, -error, 0.0, sample_s)
    assert terms.output < 10.0
    assert terms.integral < state.integral or terms.output == -10.0


@given(st.lists(values, min_size=2, max_size=30), st.floats(0.1, 100.0), st.floats(1.0, 50.0), samples)
def test_the_output_keeps_its_limits_and_its_slew(goals, slew, limit, sample_s):
    law = PidLaw(PidGains(kp=3.0, ki=1.0, kd=0.1, low=-limit, high=limit, slew=slew))
    last = None
    for goal in goals:
        output = law(goal, 0.0, sample_s).output
        assert -limit <= output <= limit
        if last is not None:
            assert abs(output - last) <= slew * sample_s + 1e-9
        last = output


@given(values, values, st.floats(-40, 40), samples)
def test_a_law_takes_over_without_a_bump(goal, measurement, output, sample_s):
    gains = PidGains(kp=2.0, ki=0.5, kd=0.3, low=-50.0, high=50.0)
    state = take_over(gains, goal, measurement, output)
    terms, _ = pid(gains, state, goal, measurement, sample_s)
    increment = abs(0.5 * (goal - measurement) * sample_s)
    assert abs(terms.output - output) <= increment + 1e-9


def test_changed_gains_give_no_bump():
    law = PidLaw(PidGains(kp=1.0, ki=1.0))
    for _ in range(10):
        before = law(5.0, 1.0, 0.1).output
    law.gains = PidGains(kp=4.0, ki=1.0)
    assert law(5.0, 1.0, 0.1).output == pytest.approx(before + 0.4)


def test_a_missing_measurement_repeats_the_output():
    law = PidLaw(PidGains(kp=1.0, ki=1.0))
    before = law(5.0, 1.0, 0.1)
    missing = law(5.0, nan, 0.1)
    assert missing.output == before.output
    assert np.isnan(missing.error)
    assert law(5.0, 1.0, 0.1).integral == pytest.approx(0.8)


def test_a_law_without_any_measurement_has_no_output():
    assert PidLaw(PidGains(kp=1.0))(5.0, nan, 0.1).output == 0.0


@given(st.floats(0.1, 500.0), st.floats(0.5, 5.0), st.floats(10.0, 500.0))
def test_the_rate_can_be_braked_at_the_stated_deceleration(error, kp, deceleration):
    terms, _ = pid(PidGains(kp=kp, deceleration=deceleration), PID_START, error, 0.0, 0.1)
    assert terms.output <= sqrt(2.0 * deceleration * error) + 1e-6
    assert terms.output <= kp * error + 1e-6


# -- angles


@given(st.floats(-1e5, 1e5))
def test_wrapped_angles_are_within_half_a_turn_and_the_same_direction(angle):
    wrapped = wrap(angle)
    assert -180.0 < wrapped <= 180.0
    assert isclose((wrapped - angle) / 360.0, round((wrapped - angle) / 360.0), abs_tol=1e-6)


@given(st.floats(-180, 180), st.floats(-180, 180), st.integers(-5, 5), st.integers(-5, 5))
def test_whole_turns_change_nothing(goal, heading, turns, more):
    gains = PidGains(kp=1.0, period=360.0)
    here, _ = pid(gains, PID_START, goal, heading, 0.1)
    there, _ = pid(gains, PID_START, goal + 360.0 * turns, heading + 360.0 * more, 0.1)
    difference = abs(here.output - there.output)
    assert min(difference, abs(difference - 360.0)) < 1e-6


def test_the_derivative_passes_through_north_without_a_spike():
    law = PidLaw(PidGains(kd=1.0, period=360.0))
    law(0.0, 359.0, 0.1)
    assert law(0.0, 1.0, 0.1).derivative == pytest.approx(-20.0)


# -- copies, cascades, On/Off


@given(st.lists(st.tuples(gains_of, gains_of, gains_of, values), min_size=1, max_size=8), samples)
@settings(max_examples=40)
def test_an_array_is_as_many_loops(copies, sample_s):
    kp, ki, kd, goal = (np.array(column) for column in zip(*copies, strict=True))
    together = PID_START
    apart = [PID_START] * len(copies)
    for step in range(4):
        measured = goal * 0.1 * step
        gains = PidGains(kp=kp, ki=ki, kd=kd, low=-100.0, high=100.0, slew=300.0)
        terms, together = pid(gains, together, goal, measured, sample_s)
        for index, (p, i, d, aim) in enumerate(copies):
            one = PidGains(kp=p, ki=i, kd=d, low=-100.0, high=100.0, slew=300.0)
            alone, apart[index] = pid(one, apart[index], aim, float(measured[index]), sample_s)
            assert isclose(terms.output[index], alone.output, rel_tol=1e-9, abs_tol=1e-9)


def test_a_cascade_gives_the_outer_output_to_the_inner_law():
    outer, inner = PidGains(kp=0.5, high=3.0, low=-3.0), PidGains(kp=2.0)
    (first, second), _ = cascade(outer, inner, CascadeState(), 100.0, (0.0, 1.0), 0.1)
    assert (first.output, second.output) == (3.0, 4.0)


def test_feed_forward_is_added_and_limited():
    terms, _ = pid(PidGains(kp=1.0, high=5.0), PID_START, 2.0, 0.0, 0.1, feed_forward=10.0)
    assert (terms.feed_forward, terms.output) == (10.0, 5.0)


def test_a_relay_has_hysteresis():
    law = OnOffLaw(OnOffGains(amplitude=7.0, hysteresis=2.0))
    outputs = [law(0.0, measured, 0.1).output for measured in (-5.0, -1.0, 1.0, 1.9, 2.1, -1.9, -2.1, nan)]
    assert outputs == [7.0, 7.0, 7.0, 7.0, -7.0, -7.0, 7.0, 7.0]


def test_a_neutral_zone_stops():
    law = OnOffLaw(OnOffGains(amplitude=7.0, hysteresis=1.0, neutral=3.0))
    outputs = [law(0.0, measured, 0.1).output for measured in (-5.0, -3.5, -2.9, -3.5, -4.5, 3.5, 4.5)]
    assert outputs == [7.0, 7.0, 0.0, 0.0, 7.0, 0.0, -7.0]


@given(st.lists(values, min_size=1, max_size=20))
def test_on_off_gives_nothing_but_its_levels(measured):
    last = 0.0
    for one in measured:
        _, last = on_off(OnOffGains(amplitude=2.0, hysteresis=1.0, neutral=5.0), last, 0.0, one)
        assert last in {-2.0, 0.0, 2.0}


# -- bad input


@pytest.mark.parametrize(
    "wrong",
    [{"kp": nan}, {"ki": -1.0}, {"filter_s": -0.1}, {"slew": 0.0}, {"low": 1.0, "high": 1.0}, {"low": nan}],
)
def test_wrong_gains_are_refused_by_name(wrong):
    with pytest.raises(UsageError, match=next(iter(wrong))):
        PidGains(**wrong)


@pytest.mark.parametrize("sample_s", [0.0, -0.1, nan, inf])
def test_a_wrong_sample_time_is_refused(sample_s):
    with pytest.raises(UsageError, match="sample time"):
        pid(PidGains(kp=1.0), PID_START, 1.0, 0.0, sample_s)


def test_an_amplitude_of_zero_is_refused():
    with pytest.raises(UsageError, match="amplitude"):
        OnOffGains(amplitude=0.0)
