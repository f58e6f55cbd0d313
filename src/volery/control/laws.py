"""Control laws as pure functions of gains, state, set-point, measurement and sample time.

A law has no clock and no memory of its own, so a flight, a test against a closed form and a tuning run over
hundreds of copies execute the same lines. Every number may be an array: then each element is a copy of the
loop with gains, state and measurement of its own. Gains are those of continuous time; ``per_sample`` converts
gains that were stated per sample.

Sources: Åström and Murray, Feedback Systems, 2nd edition, sections 11.2 to 11.5 (filtered derivative,
anti-windup, bumpless transfer); Åström and Hägglund, Automatica 20 (1984), for the relay with hysteresis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.base.errors import UsageError

Value = float | NDArray[np.float64]
"""A number, or one number for each copy of a loop."""

DEGREES = 360.0
"""Period of an angle in degrees."""


def wrap(angle: Value, period: float = DEGREES) -> Value:
    """Return *angle* within (-period / 2, period / 2].

    Args:
        angle: angle, in the unit of *period*.
        period: a full turn.
    """
    half = period / 2.0
    wrapped = half - np.mod(half - np.asarray(angle, dtype=float), period)
    return _plain(wrapped)


def _plain(value: Value) -> Value:
    """Return a number as a ``float`` and an array as it is."""
    return value if isinstance(value, np.ndarray) and value.ndim else float(value)


def _check(gains: object, *, above_zero: tuple[str, ...] = ()) -> None:
    """Check that no gain is NaN or negative.

    Raises:
        UsageError: a gain is.
    """
    for field in fields(gains):  # type: ignore[arg-type]  # every caller is a dataclass
        value = getattr(gains, field.name)
        if value is None or isinstance(value, bool | str) or field.name == "low":
            continue
        numbers = np.asarray(value, dtype=float)
        if np.isnan(numbers).any():
            raise UsageError(f"{field.name} is not a number; give one, 0 or above")
        if (numbers < 0.0).any() or (field.name in above_zero and (numbers == 0.0).any()):
            limit = "above 0" if field.name in above_zero else "0 or above"
            raise UsageError(f"{field.name}={value} is negative or zero; give one {limit}")


# -- PID


@dataclass(frozen=True, kw_only=True)
class PidGains:
    """Gains of a P, PI, PD or PID law in continuous time. A gain of 0 switches its term off.

    Attributes:
        kp: output per unit of error.
        ki: output per unit of error and second.
        kd: output per unit of error per second.
        filter_s: time constant of the derivative's filter, s.
        low: least output.
        high: greatest output.
        slew: greatest change of the output per second.
        deceleration: greatest deceleration of the measurement that the output may count on, in units of the
            measurement/s^2, where the output is a rate of the measurement: the proportional term then follows
            ``sqrt(2 deceleration error)`` for large errors, so that a fast turn can stop at its goal.
        on_measurement: whether the derivative is that of the measurement, so that a step of the set-point
            gives no spike; else that of the error.
        period: full turn of an angle in the unit of the measurement; ``None`` if it is no angle.
    """

    kp: Value = 0.0
    ki: Value = 0.0
    kd: Value = 0.0
    filter_s: Value = 0.0
    low: Value = -np.inf
    high: Value = np.inf
    slew: Value = np.inf
    deceleration: Value = np.inf
    on_measurement: bool = True
    period: float | None = None

    def __post_init__(self) -> None:
        _check(self, above_zero=("slew", "deceleration"))
        if np.isnan(self.low).any() or np.any(np.asarray(self.low) >= np.asarray(self.high)):
            raise UsageError(f"low={self.low} is not below high={self.high}; exchange them")


def per_sample(kp: float, ki: float, kd: float, sample_s: float) -> tuple[float, float, float]:
    """Return gains of continuous time for those of a law that sums and subtracts errors once a sample.

    Args:
        kp: output per unit of error.
        ki: output per unit of summed error.
        kd: output per unit of difference of two errors.
        sample_s: sample time of the law, s.
    """
    _check_sample_time(sample_s)
    return kp, ki / sample_s, kd * sample_s


class PidState(NamedTuple):
    """State of a PID law between two samples; ``PID_START`` before the first.

    ``measurement`` and ``error`` are those of the last sample, NaN before the first. ``derivative`` is the
    filtered derivative term.
    """

    integral: Value
    derivative: Value
    measurement: Value
    error: Value
    output: Value


PID_START = PidState(0.0, 0.0, np.nan, np.nan, np.nan)


class Terms(NamedTuple):
    """One sample of a law: its error and the terms whose sum, limited, is the output."""

    error: Value
    proportional: Value
    integral: Value
    derivative: Value
    feed_forward: Value
    output: Value


def pid(
    gains: PidGains,
    state: PidState,
    goal: Value,
    measurement: Value,
    sample_s: float,
    feed_forward: Value = 0.0,
) -> tuple[Terms, PidState]:
    """Return the terms of one sample and the state after it.

    The integral grows only until the output is at its limit, so it cannot wind up. A
    sample without a measurement (NaN) repeats the last output and changes nothing.

    Args:
        gains: the gains.
        state: state after the last sample.
        goal: set-point, in the unit of the measurement.
        measurement: measured value.
        sample_s: time since the last sample, s.
        feed_forward: added to the output before its limits.

    Raises:
        UsageError: the sample time is not above 0.
    """
    _check_sample_time(sample_s)
    error = _difference(gains, goal, measurement)
    proportional = _proportional(gains, error)
    derivative = _derivative(gains, state, error, measurement, sample_s)
    braking = np.abs(np.asarray(error)) > _joint(gains)  # the root limits the output, too
    increment = np.where(braking, 0.0, gains.ki * error * sample_s)
    rest = np.asarray(proportional + derivative + feed_forward)
    excess = rest + state.integral + increment
    excess = excess - _limited(gains, state.output, excess, sample_s)
    kept = np.where(excess * increment > 0.0, np.minimum(abs(excess), abs(increment)), 0.0)
    integral = state.integral + increment - np.sign(increment) * kept
    output = _limited(gains, state.output, rest + integral, sample_s)
    terms = Terms(*map(_plain, (error, proportional, integral, derivative, feed_forward, output)))
    after = PidState(*map(_plain, (integral, derivative, measurement, error, output)))
    missing = np.isnan(np.asarray(error))
    if missing.any():
        idle = np.where(np.isnan(state.output), 0.0, state.output)
        before = zip(state, after, strict=True)
        after = PidState(*(_plain(np.where(missing, old, new)) for old, new in before))
        nothing = [np.nan] * 5 + [idle]
        shown = zip(nothing, terms, strict=True)
        terms = Terms(*(_plain(np.where(missing, old, new)) for old, new in shown))
    return terms, after


def _difference(gains: PidGains, goal: Value, measurement: Value) -> Value:
    difference = np.asarray(goal, dtype=float) - np.asarray(measurement, dtype=float)
    return wrap(difference, gains.period) if gains.period is not None else _plain(difference)


def _joint(gains: PidGains) -> Value:
    """Return the error from which the stated deceleration bounds the output: ``deceleration / kp^2``."""
    if np.all(np.isinf(gains.deceleration)) or not np.any(gains.kp):
        return np.inf
    return gains.deceleration / np.square(np.maximum(gains.kp, 1e-12))


def _proportional(gains: PidGains, error: Value) -> Value:
    """Return ``kp error``, below the rate from which the stated deceleration stops at the goal.

    The root joins the line where both have the same slope (ArduPilot's ``sqrt_controller`` in AP_Math has the
    same shape).
    """
    linear = gains.kp * np.asarray(error, dtype=float)
    joint = _joint(gains)
    if np.all(np.isinf(joint)):
        return _plain(linear)
    size = np.abs(error)
    with np.errstate(invalid="ignore", over="ignore"):
        root = np.sqrt(np.maximum(2.0 * gains.deceleration * (size - joint / 2.0), 0.0))
    return _plain(np.where(size > joint, np.sign(error) * root, linear))


def _derivative(gains: PidGains, state: PidState, error: Value, measurement: Value, sample_s: float) -> Value:
    """Return the derivative term, filtered by a first-order lag (backward Euler)."""
    if gains.on_measurement:
        change = np.asarray(state.measurement) - np.asarray(measurement, dtype=float)
    else:
        change = np.asarray(error) - np.asarray(state.error)
    if gains.period is not None:
        change = np.asarray(wrap(change, gains.period))
    raw = np.where(np.isnan(change), 0.0, gains.kd * change / sample_s)
    share = sample_s / (np.asarray(gains.filter_s) + sample_s)
    return _plain(state.derivative + share * (raw - state.derivative))


def _limited(gains: PidGains, last: Value, wanted: Value, sample_s: float) -> Value:
    """Return *wanted* within the output's limits and its greatest change since the last sample."""
    inside = np.clip(wanted, gains.low, gains.high)
    step = gains.slew * sample_s
    return _plain(np.where(np.isnan(last), inside, np.clip(inside, last - step, last + step)))


def take_over(
    gains: PidGains, goal: Value, measurement: Value, output: Value, feed_forward: Value = 0.0
) -> PidState:
    """Return the state from which the law continues at *output* without a bump (bumpless transfer).

    Args:
        gains: the gains of the law that takes over.
        goal: present set-point.
        measurement: present measurement.
        output: output of the operator or the law that had control, in the law's unit.
        feed_forward: feed-forward of the first sample.
    """
    error = _difference(gains, goal, measurement)
    inside = np.clip(output, gains.low, gains.high)
    rest = inside - _proportional(gains, error) - feed_forward
    integral = np.where(np.asarray(gains.ki) > 0.0, rest, 0.0)
    return PidState(*map(_plain, (integral, np.zeros_like(inside), measurement, error, inside)))


def _check_sample_time(sample_s: float) -> None:
    if not (np.isfinite(sample_s) and sample_s > 0.0):
        raise UsageError(f"a sample time of {sample_s} s; give one above 0")


# -- cascade


class CascadeState(NamedTuple):
    """State of a cascade between two samples."""

    outer: PidState = PID_START
    inner: PidState = PID_START


def cascade(
    outer: PidGains,
    inner: PidGains,
    state: CascadeState,
    goal: Value,
    measurements: tuple[Value, Value],
    sample_s: float,
) -> tuple[tuple[Terms, Terms], CascadeState]:
    """Return the terms of both laws: the output of the outer one is the set-point of the inner one.

    Args:
        outer: gains of the outer law, such as position to velocity.
        inner: gains of the inner law, such as velocity to tilt.
        state: state after the last sample.
        goal: set-point of the outer law.
        measurements: measured value of the outer and of the inner law.
        sample_s: time since the last sample, s.
    """
    first, outer_state = pid(outer, state.outer, goal, measurements[0], sample_s)
    second, inner_state = pid(inner, state.inner, first.output, measurements[1], sample_s)
    return (first, second), CascadeState(outer_state, inner_state)


# -- On/Off


@dataclass(frozen=True, kw_only=True)
class OnOffGains:
    """An On/Off law: full output towards the goal.

    Attributes:
        amplitude: size of the output.
        hysteresis: the output changes only when the error has passed its threshold by this much.
        neutral: with an error below this the output is 0; 0 for a relay, which has no neutral output.
        period: full turn of an angle; ``None`` if the measurement is no angle.
    """

    amplitude: Value
    hysteresis: Value = 0.0
    neutral: Value = 0.0
    period: float | None = None

    def __post_init__(self) -> None:
        _check(self, above_zero=("amplitude",))


def on_off(gains: OnOffGains, last: Value, goal: Value, measurement: Value) -> tuple[Terms, Value]:
    """Return the terms of one sample and the output, which the next call takes as *last*.

    Args:
        gains: amplitude and thresholds.
        last: output of the last sample; 0 before the first.
        goal: set-point.
        measurement: measured value; NaN repeats the last output.
    """
    plain = PidGains(period=gains.period)
    error = np.asarray(_difference(plain, goal, measurement), dtype=float)
    size, towards = np.abs(error), np.sign(error)
    on = np.where(towards == 0.0, 0.0, towards) * gains.amplitude
    relay = np.asarray(gains.neutral) == 0.0
    away = towards * np.sign(last) < 0.0  # the output drives away from the goal
    idle = np.asarray(last) == 0.0
    switches = np.where(
        relay,
        idle | (away & (size > gains.hysteresis)),
        size > np.asarray(gains.neutral) + np.where(idle | away, gains.hysteresis, 0.0),
    )
    kept = np.where(relay, last, np.where((size <= gains.neutral) | away, 0.0, last))
    output = np.where(np.isnan(error), last, np.where(switches, on, kept))
    zero = np.zeros_like(output)
    terms = Terms(*map(_plain, (error, output, zero, zero, zero, output)))
    return terms, _plain(output)


# -- a law with its state, for one loop


Law = Callable[[float, float, float], Terms]
"""``law(goal, measurement, sample_s)``: a law that keeps its state, for a loop that flies."""


class PidLaw:
    """A PID law with its state. ``gains`` may be replaced while it works; the output then has no bump."""

    def __init__(self, gains: PidGains) -> None:
        self._gains = gains
        self._state = PID_START
        self._goal = np.nan

    @property
    def gains(self) -> PidGains:
        """The present gains."""
        return self._gains

    @gains.setter
    def gains(self, gains: PidGains) -> None:
        state = self._state
        if not np.isnan(state.output):
            self._state = take_over(gains, self._goal, state.measurement, state.output)
        self._gains = gains

    def __call__(self, goal: float, measurement: float, sample_s: float, feed_forward: float = 0.0) -> Terms:
        """Execute one sample."""
        self._goal = goal
        terms, self._state = pid(self._gains, self._state, goal, measurement, sample_s, feed_forward)
        return terms

    def reset(self) -> None:
        """Begin anew, as after a take-over by the operator."""
        self._state = PID_START

    def begin_at(self, output: float) -> None:
        """Begin anew without an error at an output, which the integral then holds."""
        self._state = take_over(self._gains, 0.0, 0.0, output)._replace(measurement=np.nan, error=np.nan)


class OnOffLaw:
    """An On/Off law with its state."""

    def __init__(self, gains: OnOffGains) -> None:
        self.gains = gains
        self._last: Value = 0.0

    def __call__(self, goal: float, measurement: float, sample_s: float) -> Terms:
        """Execute one sample; the sample time has no influence."""
        terms, self._last = on_off(self.gains, self._last, goal, measurement)
        return terms

    def reset(self) -> None:
        """Begin anew with no output."""
        self._last = 0.0
