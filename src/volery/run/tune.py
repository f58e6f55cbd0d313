"""``tune``: gains of a loop from a relay experiment, a fitted process and flown scenarios.

The relay is flown on the vehicle. On a simulated vehicle the gains that the fitted process suggests are
improved in flights over scenarios with wind, slow links and a loaded computer, and judged in flights over
other scenarios of the same distribution; a real vehicle is spared both, and its gains are judged on the
fitted process. All gains that are tried keep the margins of ``control.tuning``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf, nan, sqrt
from typing import NamedTuple

import numpy as np

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import Ns, to_seconds
from volery.control.flight import PERIOD
from volery.control.laws import DEGREES, OnOffGains, OnOffLaw, PidGains, PidLaw, wrap
from volery.control.manoeuvres import HEIGHT_GAINS, YAW_GAINS, Altitude, LawManoeuvre, Rotation
from volery.control.step_response import Array, StepResponse, make_signal, step_responses
from volery.control.tuning import (
    Margins,
    Oscillation,
    Process,
    cost,
    fit_process,
    is_robust,
    margins,
    optimise,
    relay_oscillation,
    scenarios,
    simc,
    with_gains,
)
from volery.run.go import GoSettings, go
from volery.run.result import Options, Tell
from volery.trace.events import ControlSample, Event
from volery.vehicles.address import parse

SAMPLE_S = 0.05
TRAINING, HELD_BACK = 16, 32
"""Scenarios on the fitted process."""
TRAINING_FLIGHTS, HELD_BACK_FLIGHTS = 6, 12
HELD_BACK_SEED = 1000
CANDIDATES = 16
"""Gains that are tried in flights."""
SPREAD = 0.12
"""Spread of the logarithm of the gains about the best ones that were flown."""
TUNED = ("kp", "ki", "kd", "deceleration")
WIDER = (1.0, 4.0, 4.0, 1.0)
"""Factors of the spread by gain: integral and derivative matter less."""

Make = Callable[[PidGains, Sequence[float]], LawManoeuvre]


@dataclass(frozen=True)
class Loop:
    """What is tuned.

    Attributes:
        name: name of the loop in records.
        relay: the relay of the experiment.
        experiment: makes the experiment.
        flown: makes a flight over set-points with gains.
        hand: gains set by hand.
        steps: sizes of steps of the scenarios on the fitted process.
        goals: draws the set-points of a flight.
        noise: standard deviation of the measurement.
        push: standard deviation of a rate that wind adds.
        seconds: duration of a simulated scenario, s.
        height: height of the take-off, m.
    """

    name: str
    relay: OnOffGains
    experiment: Callable[[OnOffLaw], LawManoeuvre]
    flown: Make
    hand: PidGains
    steps: Sequence[float]
    goals: Callable[[np.random.Generator], list[float]]
    noise: float
    push: float
    seconds: float
    height: float


def _headings(random: np.random.Generator) -> list[float]:
    """Return four turns of 30 to 175 degrees to either side, from north."""
    goals = [0.0]
    for _ in range(4):
        turn = float(random.choice([-1.0, 1.0]) * random.uniform(30.0, 175.0))
        goals.append(float(wrap(goals[-1] + turn)))
    return goals


def _heights(random: np.random.Generator) -> list[float]:
    """Return three climbs and descents of 2 to 8 m, from 8 m."""
    goals = [8.0]
    for _ in range(3):
        step = float(random.uniform(2.0, 8.0))
        goals.append(goals[-1] + (step if goals[-1] - step < 4.0 or random.random() < 0.5 else -step))
    return goals


LOOPS = {
    "rotation": Loop(
        "yaw",
        OnOffGains(amplitude=60.0, hysteresis=3.0, period=DEGREES),
        lambda law: Rotation([0.0], 25.0, law, "relay"),
        lambda gains, goals: Rotation(goals, 6.0, PidLaw(gains)),
        YAW_GAINS,
        (45.0, 90.0, 120.0, 170.0),
        _headings,
        0.1,
        3.0,
        8.0,
        5.0,
    ),
    "altitude": Loop(
        "altitude",
        OnOffGains(amplitude=0.8, hysteresis=0.1),
        lambda law: Altitude([8.0], 50.0, law, "relay"),
        lambda gains, goals: Altitude(goals, 12.0, PidLaw(gains)),
        HEIGHT_GAINS,
        (2.0, 4.0, 8.0),
        _heights,
        0.02,
        0.1,
        15.0,
        8.0,
    ),
}


class FlownScenario(NamedTuple):
    """A flight that tests gains: set-points, options of the address, sample time in ns, seed."""

    goals: list[float]
    options: str
    period: Ns
    seed: int


def flown_scenarios(loop: Loop, count: int, seed: int) -> list[FlownScenario]:
    """Return random flights in wind, over links with delay and loss.

    In a third of them a loaded computer samples half as often.

    Args:
        loop: what is tuned.
        count: number of flights.
        seed: seed of the random numbers.
    """
    random = np.random.default_rng(seed)
    found = []
    for number in range(count):
        goals = loop.goals(random)
        wind = (
            f"{random.uniform(0.0, 8.0):.1f},{random.uniform(0.0, 360.0):.0f},{random.uniform(0.0, 3.0):.1f}"
        )
        link = f"jitter={random.uniform(0.0, 0.08):.3f}&drop={random.uniform(0.0, 0.04):.3f}"
        period = int(random.choice([PERIOD, PERIOD, 2 * PERIOD]))
        found.append(FlownScenario(goals, f"wire=bytes&{link}&wind={wind}", period, 100 * seed + number))
    return found


class Judged(NamedTuple):
    """Gains, their margins on the fitted process, and what they cost over the held-back scenarios.

    ``modelled`` and ``flown`` are the IAE per unit of step in s, the latter NaN if nothing was flown.
    ``overshoot`` is the greatest of the flights as a share of the step.
    """

    name: str
    gains: PidGains
    margins: Margins
    modelled: float
    flown: float
    overshoot: float


@dataclass(frozen=True)
class TuningResult:
    """Result of ``tune``: the process, and the gains by hand, by rule and by optimisation, in this order."""

    loop: Loop
    oscillation: Oscillation
    process: Process
    judged: tuple[Judged, ...]

    @property
    def best(self) -> PidGains:
        """The tuned gains."""
        return self.judged[-1].gains


def tune(
    what: str, on: str, settings: GoSettings, options: Options, tell: Tell = lambda _: None
) -> TuningResult:
    """Tune a loop on a vehicle.

    Args:
        what: name of ``LOOPS``.
        on: address of the vehicle.
        settings: way and switch of the flights.
        options: options of the experiment's run.
        tell: called with a line about what is being done.

    Raises:
        UsageError: there is no such loop, or the experiment shows no oscillation.
        VoleryError: a flight failed.
    """
    if what not in LOOPS:
        raise UsageError(f"no loop {what!r}{did_you_mean(what, LOOPS)}; there is {choices(tuple(LOOPS))}")
    loop = LOOPS[what]
    settings = replace(settings, height=loop.height, experiment=True)
    tell("relay experiment")
    record = _fly(lambda: loop.experiment(OnOffLaw(loop.relay)), on, settings, options, loop.name)
    times, values, _, errors, outputs = record.T
    oscillation = relay_oscillation(times, errors, outputs, float(loop.relay.hysteresis))
    continuous = np.unwrap(values, period=DEGREES) if loop.relay.period is not None else values
    process = fit_process(times, continuous, outputs)
    tell("optimisation on the fitted process")
    training = scenarios(loop.steps, loop.noise, loop.push, TRAINING, options.seed)
    tuned = optimise(process, loop.hand, training, loop.seconds, options.seed)
    flights = _Flights(loop, on, settings) if parse(on).transport == "sim" else None
    if flights is not None:
        tuned = _improve(loop, tuned, process, flights, options.seed, tell)
    held_back = scenarios(loop.steps, loop.noise, loop.push, HELD_BACK, options.seed + HELD_BACK_SEED)
    judged = []
    for name, gains in (("by hand", loop.hand), ("SIMC", simc(process, loop.hand)), ("tuned", tuned)):
        tell(f"held-back scenarios: {name}")
        found = NOT_FLOWN
        if flights is not None:
            found = flights(gains, flown_scenarios(loop, HELD_BACK_FLIGHTS, options.seed + HELD_BACK_SEED))
        modelled = float(cost(gains, process, held_back, loop.seconds)[0])
        judged.append(Judged(name, gains, margins(gains, process, SAMPLE_S), modelled, *found))
    return TuningResult(loop, oscillation, process, tuple(judged))


class FlownGains(NamedTuple):
    """Mean IAE per unit of step in s, and greatest overshoot as a share of its step."""

    iae: float
    overshoot: float


NOT_FLOWN = FlownGains(nan, nan)


class _Flights:
    """Flies scenarios with gains."""

    def __init__(self, loop: Loop, on: str, settings: GoSettings) -> None:
        self._loop, self._on, self._settings = loop, on, settings

    def __call__(self, gains: PidGains, tests: Sequence[FlownScenario]) -> FlownGains:
        """Return the figures over all steps of all flights."""
        found = [response for test in tests for response in self._responses(gains, test)]
        return FlownGains(
            float(np.mean([one.iae / abs(one.size) for one in found])),
            max(one.overshoot_share for one in found),
        )

    def _responses(self, gains: PidGains, test: FlownScenario) -> list[StepResponse]:
        loop, period = self._loop, self._loop.relay.period
        url = f"{self._on}{'&' if '?' in self._on else '?'}{test.options}"
        settings = replace(self._settings, period=test.period)
        record = _fly(
            lambda: loop.flown(gains, test.goals), url, settings, Options(seed=test.seed), loop.name
        )
        times, values, aims, _, _ = record.T
        signal = make_signal(
            loop.name, "deg" if period else "m", (times, values), (times, aims), period=period
        )
        return step_responses(signal)


def _improve(
    loop: Loop, tuned: PidGains, process: Process, flights: _Flights, seed: int, tell: Tell
) -> PidGains:
    """Return the gains with the least IAE in flights, among the known ones and random ones near the best."""
    random = np.random.default_rng(seed)
    tests = flown_scenarios(loop, TRAINING_FLIGHTS, seed)
    known = [
        one for one in (tuned, loop.hand, _between(loop.hand, tuned)) if is_robust(one, process, SAMPLE_S)
    ]
    best, least = tuned, inf
    for number in range(CANDIDATES):
        gains = known[number] if number < len(known) else _near(best, process, random)
        tell(f"flights with gains {number + 1} of {CANDIDATES}")
        spent = flights(gains, tests).iae
        if spent < least:
            best, least = gains, spent
    return best


def _between(one: PidGains, other: PidGains) -> PidGains:
    """Return the geometric mean of two gains."""
    pairs = [(float(getattr(one, name)), float(getattr(other, name))) for name in TUNED]
    return with_gains(other, TUNED, [float(f"{sqrt(a * b):.4g}") for a, b in pairs])


def _near(best: PidGains, process: Process, random: np.random.Generator) -> PidGains:
    """Return random gains near the best that have the margins."""
    centre = np.array([max(float(getattr(best, name)), 1e-3) for name in TUNED])
    while True:
        drawn = centre * np.exp(SPREAD * random.standard_normal(len(TUNED)) * np.array(WIDER))
        gains = with_gains(best, TUNED, [float(f"{value:.4g}") for value in drawn])
        if is_robust(gains, process, SAMPLE_S):
            return gains


def _fly(
    make: Callable[[], LawManoeuvre], on: str, settings: GoSettings, options: Options, loop: str
) -> Array:
    """Fly and return time, measurement, set-point, error and output of each sample of a loop."""
    rows: list[tuple[float, ...]] = []

    def collect(event: Event) -> None:
        if isinstance(event, ControlSample) and event.loop == loop:
            rows.append((to_seconds(event.at), event.measurement, event.goal, event.error, event.output))

    run = go(make, on, settings, options, listener=collect)
    if not run.completed:
        raise run.error or KeyboardInterrupt  # a signal ends this flight, and with it the series
    found: Array = np.array(rows)
    if found.ndim != 2:
        raise UsageError(f"the flight recorded no sample of {loop}; did the operator keep control?")
    known: Array = found[np.isfinite(found).all(axis=1)]
    return known
