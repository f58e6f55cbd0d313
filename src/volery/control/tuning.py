"""Tuning of a loop: a relay experiment, a fitted process, robust gains, and gains optimised on scenarios.

A commanded rate becomes a quantity (heading, height) through a dead time, a rate loop with a limited
acceleration, and an integration. The relay makes that loop oscillate; the process is fitted to the record.
SIMC gives gains with known margins; the cross-entropy method improves them over scenarios with wind, slow
links and a loaded computer, under bounds on margins and sensitivity. What was tuned is judged on scenarios
that were held back.

Sources: Åström and Hägglund, Automatica 20 (1984) 645; Skogestad, J. Process Control 13 (2003) 291 (SIMC);
Rubinstein, Eur. J. Oper. Res. 99 (1997) 89 (cross-entropy).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from volery.base.errors import UsageError
from volery.control.laws import PID_START, PidGains, pid
from volery.control.step_response import Array

INTEGRATION_S = 0.01
"""Step of the simulated process, s."""
FREQUENCIES = np.geomspace(1.5, 25.0, 10)
DAMPINGS = np.array([0.4, 0.55, 0.7, 0.85, 1.0, 1.4])
ACCELERATIONS = np.array([0.75, 1.1, 1.6, 2.4, 3.5, 5.0, 8.0, 1e9])
"""The last is no limit; the others are multiples of the commanded rate's amplitude, 1/s."""
DEAD_TIMES_S = np.arange(0.0, 0.81, 0.02)
"""Values that the fit tries first."""
REFINED = np.linspace(-1.0, 1.0, 7)
"""Values about the best of them, as shares of the distance to its neighbours."""
LEAST_CYCLES = 2


class Process(NamedTuple):
    """A commanded rate that becomes a quantity.

    The transfer function is ``gain w^2 exp(-dead_s p) / (p (p^2 + 2 damping w p + w^2))``, with ``w`` the
    ``frequency``: an inner rate loop of the autopilot, the way to it and back, and an integration. The
    acceleration is limited, so a large change of the command takes longer than a small one.

    Attributes:
        gain: rate per commanded rate.
        frequency: natural frequency of the rate loop, rad/s.
        damping: its damping.
        dead_s: dead time of link, autopilot and telemetry, s.
        acceleration: greatest rate of change of the rate, units/s^2.
        misfit: standard deviation of the fitted record, in units of the quantity.
    """

    gain: float
    frequency: float
    damping: float
    dead_s: float
    acceleration: float = inf
    misfit: float = 0.0


class Oscillation(NamedTuple):
    """What a relay experiment shows.

    Attributes:
        ultimate_gain: gain at which a proportional law would oscillate, rate per unit.
        period_s: period of that oscillation, s.
        amplitude: amplitude of the measured quantity.
    """

    ultimate_gain: float
    period_s: float
    amplitude: float


def relay_oscillation(times: Array, error: Array, output: Array, hysteresis: float) -> Oscillation:
    """Return the oscillation of a relay experiment, by the describing function of a relay with hysteresis.

    Args:
        times: times of the samples, s.
        error: error of the loop.
        output: output of the relay.
        hysteresis: hysteresis of the relay, in the unit of the error.

    Raises:
        UsageError: the record has fewer than two complete oscillations.
    """
    rising = np.flatnonzero((output[:-1] <= 0.0) & (output[1:] > 0.0)) + 1
    if len(rising) < LEAST_CYCLES + 2:
        raise UsageError(
            f"{max(0, len(rising) - 1)} oscillations under the relay; a longer experiment gives more"
        )
    inside = slice(int(rising[1]), int(rising[-1]))
    period = float(np.mean(np.diff(times[rising[1:]])))
    amplitude = float(np.ptp(error[inside])) / 2.0
    relay = float(np.max(np.abs(output[inside])))
    swing = sqrt(max(amplitude**2 - hysteresis**2, 1e-12))
    return Oscillation(4.0 * relay / (pi * swing), period, amplitude)


def fit_process(times: Array, values: Array, commands: Array) -> Process:
    """Return the process that explains a record best (least squares over a grid of values, then a finer one).

    Args:
        times: times of the samples, s.
        values: measured quantity, continuous.
        commands: commanded rate.

    Raises:
        UsageError: nothing in the record moves, or not as it is commanded.
    """
    grid = np.arange(float(times[0]), float(times[-1]), INTEGRATION_S)
    moved = np.interp(grid, times, values - values[0])
    command = commands[np.maximum(np.searchsorted(times, grid, side="right") - 1, 0)]
    if np.ptp(moved) == 0.0 or np.ptp(command) == 0.0:
        raise UsageError("nothing moves in the record of the experiment")
    limits = ACCELERATIONS * float(np.max(np.abs(command)))
    coarse = _best_of_grid(moved, command, FREQUENCIES, DAMPINGS, limits, DEAD_TIMES_S)
    if not coarse.gain > 0.0:
        raise UsageError(f"the fitted gain is {coarse.gain:.3g}: the quantity does not follow its command")
    near = coarse.acceleration / coarse.gain
    fine = _best_of_grid(
        moved,
        command,
        coarse.frequency * (FREQUENCIES[1] / FREQUENCIES[0]) ** REFINED,
        coarse.damping * 1.25**REFINED,
        near * 1.4**REFINED if near < limits[-1] else limits[-1:],
        np.maximum(coarse.dead_s + np.array([-0.02, -0.01, 0.0, 0.01, 0.02]), 0.0),
    )
    unlimited = fine.acceleration >= fine.gain * limits[-1] / 2.0
    return fine._replace(acceleration=inf) if unlimited else fine


def _best_of_grid(
    moved: Array, command: Array, frequencies: Array, dampings: Array, limits: Array, dead_times: Array
) -> Process:
    """Return the process with the least misfit; ``limits`` are accelerations per gain."""
    copies = [one.ravel() for one in np.meshgrid(frequencies, dampings, limits)]
    units = np.cumsum(_rates(command, *copies), axis=0) * INTEGRATION_S
    offset_and_drift = np.stack((np.ones(len(moved)), np.arange(len(moved))), axis=1)
    basis = np.linalg.qr(offset_and_drift)[0]
    best = Process(0.0, 1.0, 1.0, 0.0, misfit=inf)
    seen = (moved - basis @ (basis.T @ moved))[:, None]
    for dead in dead_times:
        delay = round(float(dead) / INTEGRATION_S)
        late = np.concatenate((np.zeros((delay, units.shape[1])), units[: len(units) - delay]))
        late -= basis @ (basis.T @ late)
        gains = (late * seen).sum(axis=0) / np.maximum((late**2).sum(axis=0), 1e-12)
        misfits = np.std(seen - late * gains, axis=0)
        index = int(np.argmin(misfits))
        if misfits[index] < best.misfit:
            frequency, damping, limit = (copy[index] for copy in copies)
            figures = (gains[index], frequency, damping, dead, gains[index] * limit, misfits[index])
            best = Process(*map(float, figures))
    return best


def _rates(command: Array, frequencies: Array, dampings: Array, limits: Array) -> Array:
    """Return the rate of each copy of the rate loop, by time and copy."""
    rates = np.zeros((len(command), len(frequencies)))
    rate, change = np.zeros(len(frequencies)), np.zeros(len(frequencies))
    for index, wanted in enumerate(command):
        change = change + INTEGRATION_S * frequencies * (
            frequencies * (wanted - rate) - 2.0 * dampings * change
        )
        change = np.clip(change, -limits, limits)
        rate = rate + INTEGRATION_S * change
        rates[index] = rate
    return rates


# -- robustness


class Margins(NamedTuple):
    """Robustness of a loop: gain margin as a factor, phase margin in degrees, greatest sensitivity."""

    gain: float
    phase: float
    sensitivity: float


def open_loop(gains: PidGains, process: Process, sample_s: float, frequencies: Array) -> Array:
    """Return the complex open loop at *frequencies* (rad/s), with the hold of the sampled law as a delay.

    Args:
        gains: gains of the law, without its limits.
        process: the process.
        sample_s: sample time, s.
        frequencies: frequencies, rad/s.
    """
    s = 1j * frequencies
    back = np.exp(-s * sample_s)  # one sample back
    share = sample_s / (float(gains.filter_s) + sample_s)
    integral = float(gains.ki) * sample_s / (1.0 - back)
    derivative = float(gains.kd) * share * (1.0 - back) / sample_s / (1.0 - (1.0 - share) * back)
    law = float(gains.kp) + integral + derivative
    square = process.frequency**2
    inner = square / (s * s + 2.0 * process.damping * process.frequency * s + square)
    plant = process.gain * np.exp(-s * (process.dead_s + sample_s / 2.0)) * inner / s
    loop: Array = law * plant
    return loop


def margins(gains: PidGains, process: Process, sample_s: float) -> Margins:
    """Return the margins of a loop.

    Args:
        gains: gains of the law, without its limits.
        process: the process.
        sample_s: sample time, s.
    """
    frequencies = np.geomspace(1e-2, pi / sample_s, 4000)
    loop = open_loop(gains, process, sample_s, frequencies)
    phase, size = np.unwrap(np.angle(loop)), np.abs(loop)
    phase -= 2.0 * pi * np.round((phase[0] + pi / 2.0) / (2.0 * pi))  # begins between -pi and 0
    crossing = _crossings(size, 1.0)
    turned = _crossings(-phase, pi)
    phases = [float(np.interp(at, np.arange(len(phase)), phase)) + pi for at in crossing]
    gain = min((1.0 / float(np.interp(at, np.arange(len(size)), size)) for at in turned), default=inf)
    sensitivity = float(np.max(1.0 / np.abs(1.0 + loop)))
    return Margins(gain, float(np.degrees(min(phases, default=inf))), sensitivity)


def _crossings(values: Array, level: float) -> list[float]:
    """Return the interpolated indexes at which *values* cross *level*."""
    above = values > level
    at = np.flatnonzero(above[1:] != above[:-1])
    return [float(one + (level - values[one]) / (values[one + 1] - values[one])) for one in at]


def simc(process: Process, base: PidGains, closed_s: float | None = None) -> PidGains:
    """Return the gains of Skogestad's rules for an integrating process.

    Args:
        process: the process; the lags of its rate loop count as dead time.
        base: limits, filter and the rest.
        closed_s: wished time constant of the closed loop, s; by default the dead time.
    """
    dead = process.dead_s + 2.0 * process.damping / process.frequency
    together = dead + (dead if closed_s is None else closed_s)
    kp = 1.0 / (process.gain * together)
    return replace(base, kp=kp, ki=kp / (4.0 * together), kd=0.0)


# -- scenarios


class TuningScenario(NamedTuple):
    """One test of a law.

    Attributes:
        step: size of the step.
        delay_s: further dead time of a slow link, s.
        sample_s: sample time: a loaded computer or a slow link samples less often.
        push: disturbance of the rate, by wind.
        noise: standard deviation of the measurement.
        gain: factor of the process's gain.
    """

    step: float
    delay_s: float
    sample_s: float
    push: float
    noise: float
    gain: float


def scenarios(
    steps: Sequence[float], noise: float, push: float, count: int, seed: int
) -> list[TuningScenario]:
    """Return random scenarios.

    Args:
        steps: sizes of steps.
        noise: standard deviation of the measurement.
        push: standard deviation of the rate that wind adds.
        count: number of scenarios.
        seed: seed of the random numbers.
    """
    random = np.random.default_rng(seed)
    return [
        TuningScenario(
            float(random.choice(steps)),
            float(random.uniform(0.0, 0.08)),
            float(random.choice([0.05, 0.05, 0.1])),
            float(random.normal(0.0, push)),
            noise,
            float(random.uniform(0.85, 1.15)),
        )
        for _ in range(count)
    ]


def cost(
    gains: PidGains, process: Process, tests: Sequence[TuningScenario], seconds: float, seed: int = 1
) -> Array:
    """Return for each copy of the gains the mean IAE per unit of step over scenarios, in s.

    Args:
        gains: gains; each may be an array with one element for each copy.
        process: the process.
        tests: the scenarios.
        seconds: duration of a test, s.
        seed: seed of the measurement noise.
    """
    copies = max(np.size(getattr(gains, name)) for name in ("kp", "ki", "kd", "deceleration"))
    total = np.zeros(copies)
    for sample_s in sorted({test.sample_s for test in tests}):
        same = [test for test in tests if test.sample_s == sample_s]
        total += _simulate(gains, process, same, seconds, copies, seed).sum(axis=1)
    return total / len(tests)


def _simulate(
    gains: PidGains, process: Process, tests: Sequence[TuningScenario], seconds: float, copies: int, seed: int
) -> Array:
    """Return the cost by copy and scenario; all scenarios have the same sample time."""
    sample_s = tests[0].sample_s
    step, delay, push, noise, factor = (
        np.array([getattr(test, name) for test in tests])
        for name in ("step", "delay_s", "push", "noise", "gain")
    )
    shape = (copies, len(tests))
    columns: dict[str, Any] = {
        name: np.reshape(getattr(gains, name), (-1, 1))
        if np.ndim(getattr(gains, name))
        else getattr(gains, name)
        for name in ("kp", "ki", "kd", "deceleration")
    }
    law = replace(gains, **columns, period=None)
    late = np.round((process.dead_s + delay) / INTEGRATION_S).astype(int)
    random = np.random.default_rng(seed)
    every = round(sample_s / INTEGRATION_S)
    count = round(seconds / INTEGRATION_S)
    commands = np.zeros((int(late.max()) + 1, *shape))
    value, rate, command = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    state, spent = PID_START, np.zeros(shape)
    change, own, damping = np.zeros(shape), process.frequency, 2.0 * process.damping
    across = np.arange(len(tests))
    for index in range(count):
        if index % every == 0:
            measured = value + noise * random.standard_normal(len(tests))
            terms, state = pid(law, state, np.broadcast_to(step, shape), measured, sample_s)
            command = np.asarray(terms.output)
        commands[index % len(commands)] = command
        old = commands[(index - late) % len(commands), :, across].T if index else command * 0.0
        wanted = process.gain * factor * old + push
        change = change + INTEGRATION_S * own * (own * (wanted - rate) - damping * change)
        change = np.clip(change, -process.acceleration, process.acceleration)
        rate = rate + INTEGRATION_S * change
        value = value + rate * INTEGRATION_S
        spent += np.abs((step - value) / step) * INTEGRATION_S
    return spent


# -- optimisation


CANDIDATES, ELITE, ROUNDS = 96, 16, 8
LEAST_GAIN_MARGIN, LEAST_PHASE_MARGIN, GREATEST_SENSITIVITY = 2.0, 45.0, 2.0
"""Bounds of the optimisation: 6 dB, 45 degrees, and the greatest sensitivity Ms (usually 1.4 to 2)."""


def optimise(
    process: Process, start: PidGains, tests: Sequence[TuningScenario], seconds: float, seed: int = 1
) -> PidGains:
    """Return gains that lower the cost over scenarios, among those with the least margins.

    Args:
        process: the process.
        start: gains to begin with; their limits and filter are kept.
        tests: scenarios to tune on.
        seconds: duration of a test, s.
        seed: seed of the search.

    Raises:
        UsageError: no gains near the start have the margins.
    """
    random = np.random.default_rng(seed)
    names = ("kp", "ki", "kd", "deceleration")
    usual = (
        start.kp,
        max(float(start.ki), 1e-3),
        max(float(start.kd), 1e-3),
        min(float(start.deceleration), 1e6),
    )
    centre, spread = np.log(np.array(usual, dtype=float)), np.array([0.5, 0.8, 0.8, 0.6])
    best, least = None, inf
    known = [[float(getattr(one, name)) for name in names] for one in (start, simc(process, start))]
    for _ in range(ROUNDS):
        drawn = np.exp(centre + spread * random.standard_normal((CANDIDATES, len(names))))
        tried = np.concatenate((drawn, np.maximum(known, 1e-9)))
        safe = np.array([one for one in tried if is_robust(with_gains(start, names, one), process)])
        if not len(safe):
            centre[0] -= 0.5
            continue
        costs = cost(with_gains(start, names, safe.T), process, tests, seconds)
        order = np.argsort(costs)
        if costs[order[0]] < least:
            best, least = safe[order[0]], float(costs[order[0]])
        elite = np.log(safe[order[:ELITE]])
        centre, spread = elite.mean(axis=0), np.maximum(elite.std(axis=0), 0.05)
    if best is None:
        raise UsageError(
            f"no gains near the start have a gain margin of {LEAST_GAIN_MARGIN:g}, a phase margin of "
            f"{LEAST_PHASE_MARGIN:g} degrees and a sensitivity below {GREATEST_SENSITIVITY:g}"
        )
    return with_gains(start, names, [float(f"{value:.4g}") for value in best])


def with_gains(gains: PidGains, names: Sequence[str], values: Sequence[float] | Array) -> PidGains:
    """Return *gains* with the fields called *names* replaced."""
    return replace(gains, **dict(zip(names, values, strict=True)))


def is_robust(gains: PidGains, process: Process, sample_s: float = 0.05) -> bool:
    """Return whether a loop has the least margins and no more than the greatest sensitivity."""
    found = margins(gains, process, sample_s)
    return (
        found.gain >= LEAST_GAIN_MARGIN
        and found.phase >= LEAST_PHASE_MARGIN
        and found.sensitivity <= GREATEST_SENSITIVITY
    )


def as_toml(loop: str, gains: PidGains, comment: str) -> str:
    """Return the gains of a loop as the text of a file that ``volery control go --gains`` reads."""
    lines = [f"# {comment}", f"[{loop}]"]
    for name in ("kp", "ki", "kd", "filter_s", "deceleration"):
        value = float(getattr(gains, name))
        lines.append(f"{name} = {value:g}")
    return "\n".join(lines) + "\n"
