"""``tune``: gains of a loop from a relay experiment, a fitted process and flown scenarios.

The relay is flown on the vehicle. On a simulated vehicle the gains that the fitted process suggests are
improved in flights over scenarios with wind and slow links, and judged in flights over scenarios that were
held back; a real vehicle is spared both, and its gains are judged on the fitted process.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

import numpy as np

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import to_seconds
from volery.control.laws import DEGREES, OnOffGains, OnOffLaw, PidGains, PidLaw
from volery.control.manoeuvres import HEIGHT_GAINS, YAW_GAINS, Altitude, Manoeuvre, Rotation
from volery.control.step_response import Array, make_signal, step_responses
from volery.control.tuning import (
    Margins,
    Oscillation,
    Process,
    Scenario,
    cost,
    fit_process,
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
CANDIDATES = 8
"""Gains that are tried in flights."""
OVERSHOOT_ALLOWED, OVERSHOOT_WEIGHT = 0.05, 1.0
LEAST_MARGIN = 1.6
"""Least gain margin of gains that are tried in flights."""

Make = Callable[[PidGains, Sequence[float]], Manoeuvre]


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
        training: set-points of the flown scenarios to tune on.
        held_back: set-points of the flown scenarios that judge.
        noise: standard deviation of the measurement.
        push: standard deviation of a rate that wind adds.
        seconds: duration of a simulated scenario, s.
        height: height of the take-off, m.
    """

    name: str
    relay: OnOffGains
    experiment: Callable[[OnOffLaw], Manoeuvre]
    flown: Make
    hand: PidGains
    steps: Sequence[float]
    training: Sequence[float]
    held_back: Sequence[float]
    noise: float
    push: float
    seconds: float
    height: float


LOOPS = {
    "rotation": Loop(
        "yaw",
        OnOffGains(amplitude=60.0, hysteresis=3.0, period=DEGREES),
        lambda law: Rotation([0.0], 25.0, law, "relay"),
        lambda gains, goals: Rotation(goals, 6.0, PidLaw(gains)),
        YAW_GAINS,
        (45.0, 90.0, 120.0, 170.0),
        (0.0, 90.0, -60.0, 110.0),
        (0.0, 45.0, 165.0, 75.0, -100.0),
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
        (8.0, 12.0, 6.0),
        (8.0, 10.0, 16.0, 9.0),
        0.02,
        0.1,
        15.0,
        8.0,
    ),
}
TRAINING_LINKS = ("", "wire=bytes&jitter=0.1", "wind=5,200,4")
HELD_BACK_LINKS = ("wire=bytes&jitter=0.06&drop=0.03", "wind=7,90,3", "wire=bytes&baud=57600&drop=0.05")


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
class Tuning:
    """Result of ``tune``: the process, and the gains by hand, by rule and by optimisation, in this order."""

    loop: Loop
    oscillation: Oscillation
    process: Process
    judged: tuple[Judged, ...]

    @property
    def best(self) -> PidGains:
        """The tuned gains."""
        return self.judged[-1].gains


def tune(what: str, on: str, settings: GoSettings, options: Options, tell: Tell = lambda _: None) -> Tuning:
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
    settings = replace(settings, height=loop.height)
    tell("relay experiment")
    record = _fly(lambda: loop.experiment(OnOffLaw(loop.relay)), on, settings, options, loop.name)
    times, values, _, errors, outputs = record.T
    oscillation = relay_oscillation(times, errors, outputs, float(loop.relay.hysteresis))
    continuous = np.unwrap(values, period=DEGREES) if loop.relay.period is not None else values
    process = fit_process(times, continuous, outputs)
    tell("optimisation on the fitted process")
    training = scenarios(loop.steps, loop.noise, loop.push, TRAINING, options.seed)
    tuned = optimise(process, loop.hand, training, loop.seconds, options.seed)
    simulated = parse(on).transport == "sim"
    if simulated:

        def train(gains: PidGains) -> Flights:
            return _flights(loop, gains, on, settings, TRAINING_LINKS, loop.training)

        tuned = _improve(loop, tuned, process, train, options.seed, tell)
    held_back = scenarios(loop.steps, loop.noise, loop.push, HELD_BACK, options.seed + 1000)
    judged = []
    for name, gains in (("by hand", loop.hand), ("SIMC", simc(process, loop.hand)), ("tuned", tuned)):
        tell(f"held-back scenarios: {name}")
        flown = _flights(loop, gains, on, settings, HELD_BACK_LINKS, loop.held_back) if simulated else None
        judged.append(_judge(loop, name, gains, process, held_back, flown))
    return Tuning(loop, oscillation, process, tuple(judged))


def _judge(
    loop: Loop, name: str, gains: PidGains, process: Process, tests: Sequence[Scenario], flown: Flights | None
) -> Judged:
    modelled = float(cost(gains, process, tests, loop.seconds)[0])
    found = flown or Flights(float("nan"), float("nan"))
    return Judged(name, gains, margins(gains, process, SAMPLE_S), modelled, found.iae, found.overshoot)


class Flights(NamedTuple):
    """Mean IAE per unit of step in s, and greatest overshoot as a share of its step."""

    iae: float
    overshoot: float

    @property
    def cost(self) -> float:
        """IAE with a penalty on overshoot."""
        return self.iae + OVERSHOOT_WEIGHT * max(0.0, self.overshoot - OVERSHOOT_ALLOWED)


Fly = Callable[[PidGains], Flights]


def _improve(loop: Loop, tuned: PidGains, process: Process, flights: Fly, seed: int, tell: Tell) -> PidGains:
    """Return the best of *tuned*, the gains by hand and gains between and about them, by flights."""
    random = np.random.default_rng(seed)
    names = ("kp", "ki", "kd", "deceleration")
    given = [[float(getattr(one, name)) for name in names] for one in (loop.hand, tuned)]
    ends = np.log(np.maximum(given, 1e-3))
    best, least = tuned, inf
    for number in range(CANDIDATES):
        drawn = ends[number] if number < len(ends) else _between(ends, random)
        gains = with_gains(tuned, names, [float(f"{value:.4g}") for value in np.exp(drawn)])
        if number >= len(ends) and margins(gains, process, SAMPLE_S).gain < LEAST_MARGIN:
            continue
        tell(f"flights with gains {number + 1} of {CANDIDATES}")
        spent = flights(gains).cost
        if spent < least:
            best, least = gains, spent
    return best


def _between(ends: Array, random: np.random.Generator) -> Array:
    """Return a random point near the line between two points."""
    share = random.uniform(0.0, 1.0)
    point: Array = ends[0] * (1.0 - share) + ends[1] * share + 0.2 * random.standard_normal(ends.shape[1])
    return point


def _flights(
    loop: Loop, gains: PidGains, on: str, settings: GoSettings, links: Sequence[str], goals: Sequence[float]
) -> Flights:
    """Fly the set-points over each kind of link and weather."""
    iae, overshoot = [], 0.0
    for number, link in enumerate(links):
        url = f"{on}{'&' if '?' in on else '?'}{link}" if link else on
        record = _fly(lambda: loop.flown(gains, goals), url, settings, Options(seed=number + 1), loop.name)
        times, values, aims, _, _ = record.T
        period = loop.relay.period
        signal = make_signal(
            loop.name, "deg" if period else "m", (times, values), (times, aims), period=period
        )
        for found in step_responses(signal):
            iae.append(found.iae / abs(found.size))
            overshoot = max(overshoot, found.overshoot_share)
    return Flights(float(np.mean(iae)), overshoot)


def _fly(make: Callable[[], Manoeuvre], on: str, settings: GoSettings, options: Options, loop: str) -> Array:
    """Fly and return time, measurement, set-point, error and output of each sample of a loop."""
    rows: list[tuple[float, ...]] = []

    def collect(event: Event) -> None:
        if isinstance(event, ControlSample) and event.loop == loop:
            rows.append((to_seconds(event.at), event.measurement, event.goal, event.error, event.output))

    run = go(make, on, settings, options, listener=collect)
    if run.error is not None:
        raise run.error
    found: Array = np.array(rows)
    if found.ndim != 2:
        raise UsageError(f"the flight recorded no sample of {loop}; did the operator keep control?")
    known: Array = found[np.isfinite(found).all(axis=1)]
    return known
