"""Rounds of a probe whose calls cost exactly what a law says, but for noise."""

from __future__ import annotations

from volery.base.seeds import stream
from volery.calibration.ros.call_costs import FOLLOWING, ProbeSample, Round

OWN, IDLE = 40_000.0, 0.001
"""ns that the probe's own looking takes; ns of the library's threads for each ns on the wall."""

ONCE = {
    "init": 200_000.0,
    "node_handle": 1_500_000.0,
    "advertise": 190_000.0,
    "subscribe": 250_000.0,
    "connect": 250_000.0 + 800_000.0,
    "service_client": 7_000.0,
    "advertise_service": 38_000.0,
}
PUBLISH, PER_SUBSCRIBER, AGAIN = 75_000.0, 18_000.0, 40_000.0
SLEEP, PER_US = 14_000.0, 1.05
ACCEPT, SPIN, RECEIVE, RECEIVE_NEXT = 480_000.0, 5_000.0, 90_000.0, 30_000.0
PERIOD_US = 50_000.0
WARMER = 0.75
"""Cost of a publication in cycles of less than 32 ms, relative to longer ones."""
CYCLES = 12


class Probe:
    """``noise`` is relative, on every sample of its own."""

    def __init__(
        self, seed: int = 1, noise: float = 0.0, spins: bool = True, period_us: float = PERIOD_US
    ) -> None:
        self._random = stream(seed, "probe")
        self._noise, self._spins, self._period_us = noise, spins, period_us

    def _sample(self, what: str, x: float, cycles: int, each: float, waited: float = 1e8) -> ProbeSample:
        if cycles == CYCLES:
            waited = CYCLES * self._period_us * 1e3
        process = each * cycles * (1.0 + self._random.gauss(0.0, self._noise))
        return ProbeSample(what, x, cycles, round(waited), round(process), round(process / 2))

    def _once(self, what: str, cost: float, x: float = 0.0) -> ProbeSample:
        return self._sample(what, x, 1, OWN + cost + IDLE * 1e8)

    def round(self, counts: tuple[int, ...] = (1, 2, 4, 8)) -> Round:
        warmth = 1.0 if self._period_us >= PERIOD_US else WARMER
        idle = SLEEP + PER_US * PERIOD_US
        samples = [self._sample("nothing", 0, 1, OWN)]
        samples += [self._once(what, cost) for what, cost in ONCE.items()]
        samples += [self._once("settle", 0.0), self._once("settle", 0.0)]
        for ms in (10, 20, 50, 100):
            samples.append(self._sample("sleep", ms * 1000, CYCLES, SLEEP + PER_US * ms * 1000))
        for count in counts:
            cost = warmth * (PUBLISH + PER_SUBSCRIBER * count)
            samples.append(self._once("accept", ONCE["advertise"] + ACCEPT * count, count))
            samples.append(self._sample("idle", 0, CYCLES, idle))
            samples.append(self._sample("publish", count, CYCLES, idle + cost))
        alone = idle + warmth * (PUBLISH + PER_SUBSCRIBER)
        both = alone + warmth * FOLLOWING * (AGAIN + 2 * PER_SUBSCRIBER)
        samples.append(self._sample("publish_alone", 0, CYCLES, alone))
        samples.append(self._sample("publish_both", 2, CYCLES, both))
        if self._spins:
            samples.append(self._sample("spin_once_first", 0, 1, 20_000.0))
            samples.append(self._sample("spin_once", 0, CYCLES, both + SPIN))
        samples.append(self._sample("wait", 0, 1, 2e6, 1e9))
        for messages, warm in ((20, 1.0), (50, WARMER)):  # in a second
            idle, burst = 2e6 / messages, warm * (RECEIVE + 4 * RECEIVE_NEXT)
            spin = SPIN if self._spins else 0.0
            samples.append(self._sample("receive", 1, messages, idle + warm * RECEIVE + spin, 1e9))
            samples.append(self._sample("receive_burst", 5, 5 * messages, (idle + burst) / 5 + spin, 1e9))
        return tuple(samples)
