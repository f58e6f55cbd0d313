"""Prices of a node's calls into ROS: a law at the frequency of a processor."""

from __future__ import annotations

from typing import NamedTuple

from volery.base.errors import EstimateError, choices
from volery.base.time import Ns
from volery.base.warmth import COLD, Warmth
from volery.cost.figures import Line
from volery.cost.ros_law import BACKGROUND_EVENTS, ENDINGS, SERVICE_CALLS, RosLaw

_SPIN = {1.0: "spin_once_first", 0.0: "spin_once_next"}
_MAX_CACHED = 4096
"""Prices that a tariff keeps; sleeps of many different lengths must not fill the memory."""


class Price(NamedTuple):
    """Execution time of one call on the target, ns: of the caller, and of its process in the background.

    ``flags`` say what is doubtful about it.
    """

    caller: Ns
    background: Ns
    flags: tuple[str, ...] = ()


NO_PRICE = Price(0, 0)


class Tariff:
    """The prices of a law at one frequency."""

    def __init__(self, law: RosLaw, frequency_mhz: float) -> None:
        self.law = law
        self.frequency_mhz = frequency_mhz
        self.warnings = law.warnings(frequency_mhz)
        self._parts: dict[str, tuple[float, float]] = {}
        self._callers: dict[str, tuple[float, float]] = {}
        self._known: dict[tuple[str, float, Warmth], Price] = {}
        for call, figures in law.calls.items():
            self._parts[call] = _at(frequency_mhz, *figures.lines())
            if figures.caller is not None:
                self._callers[call] = _at(frequency_mhz, figures.caller, figures.caller_per_x)

    def __call__(self, call: str, x: float = 0.0, warmth: Warmth = COLD) -> Price:
        """Return the price of one call.

        Args:
            call: Name of the call or of a background event.
            x: Number of subscribers of ``publish``, time slept in microseconds of ``sleep``.
            warmth: Of the process that sends or receives.

        Raises:
            EstimateError: The call has no figure, or its line gives a negative time at this frequency.
        """
        known = self._known.get((call, x, warmth))
        if known is None:
            known = self._compute(call, x, warmth)
            if len(self._known) < _MAX_CACHED:
                self._known[call, x, warmth] = known
        return known

    def _name(self, call: str, x: float, warmth: Warmth) -> str:
        """Return the name of the law's figures for a call."""
        if call == "spin_once":
            return _SPIN.get(x, call)
        names = [call + ending for ending in ENDINGS[warmth]]
        return next((name for name in names if name in self._parts), call)

    def _compute(self, call: str, x: float, warmth: Warmth) -> Price:
        name = self._name(call, x, warmth)
        if name not in self._parts and (call in BACKGROUND_EVENTS or call in SERVICE_CALLS):
            return NO_PRICE
        if name not in self._parts:
            raise EstimateError(
                f"no figure for the ROS call {name!r} of {self.law.client} on {self.law.processor}; "
                f"there is {choices(self._parts)}"
            )
        constant, per_x = self._parts[name]
        variable = per_x * x
        if constant < 0.0 or variable < 0.0:
            raise EstimateError(
                f"the {self.law.client} figures of {self.law.processor} give a negative time for {name!r} at "
                f"{self.frequency_mhz:g} MHz; they hold from {self.law.least_mhz:g} to "
                f"{self.law.greatest_mhz:g} MHz"
            )
        if call == "sleep" or call in BACKGROUND_EVENTS:  # a sleep's cost falls while it sleeps
            return Price(0, round(constant + variable), self._flags(name))
        return self._split(name, constant, variable, x)

    def _split(self, name: str, constant: float, variable: float, x: float) -> Price:
        """Divide the cost of a call between the caller and the background."""
        flags = self._flags(name)
        whole = round(constant + variable)
        if name in self._callers:
            fixed, per_x = self._callers[name]
            caller = min(whole, max(0, round(fixed + per_x * x)))
            return Price(caller, whole - caller, flags)
        return Price(round(constant), round(variable), flags)

    def _flags(self, name: str) -> tuple[str, ...]:
        figures = self.law.calls[name]
        if figures.doubtful_mhz and self.frequency_mhz > min(figures.points or {0.0: 0.0}):
            return (*self.warnings, f"{name}: {figures.note}")
        return self.warnings


def _at(frequency_mhz: float, constant: Line, per_x: Line | None) -> tuple[float, float]:
    return constant.at(frequency_mhz), per_x.at(frequency_mhz) if per_x else 0.0
