"""On-board computers drain the battery of the vehicle that feeds them.

Their busy time is looked at once a period, and what they drew on average goes to the vehicle's body as
payload power for the next period: the battery is late by one period and misses nothing but the last one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from volery.base.errors import EstimateError
from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.run.platform import Platform

if TYPE_CHECKING:
    from volery.run.airfield import Airfield

PERIOD: Ns = 500 * MS


class PowerFeed:
    """Feeds the computers of one platform from the batteries of one airfield."""

    def __init__(self, kernel: Kernel, platform: Platform, airfield: Airfield) -> None:
        self._kernel = kernel
        self._platform = platform
        self._airfield = airfield
        self._fed = platform.powered_by()
        self._busy: dict[str, Ns] = {name: 0 for names in self._fed.values() for name in names}
        self._then: Ns = kernel.now()
        for name in self._busy:
            self._check(name)
        for vehicle, names in self._fed.items():
            airfield.flights[vehicle].payload_power(sum(platform.watts(name, 0.0) for name in names))
        if self._fed:
            kernel.every(PERIOD, self._feed)

    def _check(self, processor: str) -> None:
        try:
            self._platform.watts(processor, 0.0)
        except EstimateError as error:
            raise EstimateError(f"{processor} is powered by a vehicle: {error}") from error

    def _feed(self) -> None:
        now = self._kernel.now()
        if now == self._then:
            return
        for vehicle, names in self._fed.items():
            self._airfield.flights[vehicle].payload_power(sum(self._watts(name, now) for name in names))
        self._then = now

    def _watts(self, processor: str, now: Ns) -> float:
        busy = self._platform.processors[processor].busy_ns(now)
        cores = (busy - self._busy[processor]) / (now - self._then)
        self._busy[processor] = busy
        return self._platform.watts(processor, cores)
