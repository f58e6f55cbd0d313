"""Cost of a call into ROS on the processor of the calling node.

Law (Modeling and Performance Estimation of Robotic Systems using ROS, formulas 1 and 2):

    call with an x:     time_ns = (a f + b) x + (c f + d)
    call without one:   time_ns = c f + d

f is the processor's frequency; x is the number of subscribers for ``publish`` and the time slept in
microseconds for ``sleep``. Coefficients were fitted to the CPU time of the whole process (the calling thread
and the client library's own threads) at two frequencies per processor; a call without x is the line through
its two points.

Validity: between the two frequencies. No dependence on publish rate, message size or queue size was
observed. Error against the measured ROS time of a whole controller: 17 to 42 %, always too low (Table III).

Threads that are charged: the paper states sums. Measurements of roscpp show that ``publish`` itself takes
constant time and the library's threads spend the part per subscriber, and that the cost of a sleep falls
while it sleeps. So

* ``publish``: the caller pays the constant part, the part per subscriber is background;
* ``sleep``: all of it is background;
* every other call: the caller pays all of it.

Separately measured figures (``caller``, ``caller_per_x``) take precedence over this rule.

A node also has costs beside its calls (``BACKGROUND_EVENTS``): a message arrives, a peer connects, time
passes in ``spin``. The paper does not price them; a law with figures for them does, all in the background.
"""

from __future__ import annotations

from typing import NamedTuple

from pydantic import model_validator

from volery.base.errors import EstimateError, choices
from volery.base.time import Ns
from volery.cost.figures import Line, WithProvenance, line_through

NOT_COUNTED = (
    "ROS service requests, where a law has no figures for them (0.7 ms each were measured for rospy)",
    "ROS parameter, name and time look-ups",
    "ROS discovery and the master",
    "connections, messages received and time spent in spin, where a law has no figures for them",
)
"""What the law leaves out, as phrases for a report."""

WARMER_CALLS = {
    f"{call}{ending}": f"{call}{than}"
    for call in ("publish", "receive")
    for ending, than in (("_next", ""), ("_often", ""), ("_next_often", "_next"))
}
"""Calls shortly after the library has sent or received (``next``), when its threads are awake, and in loops
of some 20 ms (``often``), where caches are warmer; each with the call whose price holds where a law does not
distinguish them."""

BACKGROUND_EVENTS = (
    "receive", "receive_next", "receive_often", "receive_next_often", "connect", "accept", "wait"
)  # fmt: skip
"""Events beside calls, which cost nothing where a law has no figure.

A message is received; a subscription connects to a publisher; a publisher accepts a subscription's
connection; x microseconds pass in ``spin``.
"""

SERVICE_CALLS = ("call_service", "serve")
"""A request, for its caller and for its server: they cost nothing where a law has no figure."""

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


class CallFigures(WithProvenance):
    """Figures of one call: coefficients over the frequency, or two points.

    Attributes:
        constant: Part without x, ns.
        per_x: Part per x, ns, if the call has an x.
        caller: Part of ``constant`` that the calling thread spends, ns, where it was measured.
        caller_per_x: Part of ``per_x`` that the calling thread spends, ns.
        error: Relative error band of a typical call.
        points: Two measured points, {MHz: ns}, in place of ``constant`` and ``per_x``.
        doubtful_mhz: Frequencies whose figure the note calls into question.
    """

    constant: Line | None = None
    per_x: Line | None = None
    caller: Line | None = None
    caller_per_x: Line | None = None
    error: float | None = None
    points: dict[float, float] | None = None
    doubtful_mhz: tuple[float, ...] = ()

    @model_validator(mode="after")
    def _one_form(self) -> CallFigures:
        if (self.constant is None) == (self.points is None):
            raise ValueError("give either 'constant' (and 'per_x') or 'points'")
        if self.points is not None and len(self.points) != 2:
            raise ValueError("'points' are two: one at each measured frequency")
        return self

    def lines(self) -> tuple[Line, Line | None]:
        """Return the constant part and the part per x over the frequency, ns."""
        if self.points is not None:
            return line_through(self.points), None
        assert self.constant is not None  # by validation
        return self.constant, self.per_x


class RosLaw(WithProvenance):
    """The law of one client library on one kind of processor. ``error`` is its relative error band."""

    client: str
    least_mhz: float
    greatest_mhz: float
    error: float
    calls: dict[str, CallFigures]
    processor: str = ""
    charged_as: str = ""

    def warnings(self, frequency_mhz: float) -> tuple[str, ...]:
        """Return the warnings of a report that uses this law at a frequency in MHz."""
        found = []
        if not self.least_mhz <= frequency_mhz <= self.greatest_mhz:
            found.append(
                f"{self.processor} at {frequency_mhz:g} MHz is outside the range of its {self.client} "
                f"figures, {self.least_mhz:g} to {self.greatest_mhz:g} MHz: extrapolated"
            )
        if self.charged_as:
            found.append(
                f"{self.charged_as} nodes on {self.processor} are charged with {self.client} figures: "
                f"no figures of {self.charged_as} are in the catalogue"
            )
        return tuple(found)

    def price(self, call: str, x: float, frequency_mhz: float) -> Price:
        """Return the price of one call. See ``Tariff``."""
        return self.at(frequency_mhz)(call, x)

    def at(self, frequency_mhz: float) -> Tariff:
        """Return the law at one frequency in MHz."""
        return Tariff(self, frequency_mhz)


class Tariff:
    """The prices of a law at one frequency."""

    def __init__(self, law: RosLaw, frequency_mhz: float) -> None:
        self.law = law
        self.frequency_mhz = frequency_mhz
        self.warnings = law.warnings(frequency_mhz)
        self._parts: dict[str, tuple[float, float]] = {}
        self._callers: dict[str, tuple[float, float]] = {}
        self._known: dict[tuple[str, float], Price] = {}
        for call, figures in law.calls.items():
            self._parts[call] = _at(frequency_mhz, *figures.lines())
            if figures.caller is not None:
                self._callers[call] = _at(frequency_mhz, figures.caller, figures.caller_per_x)

    def __call__(self, call: str, x: float = 0.0) -> Price:
        """Return the price of one call.

        Args:
            call: Name of the call or of a background event.
            x: Number of subscribers of ``publish``, time slept in microseconds of ``sleep``.

        Raises:
            EstimateError: The call has no figure, or its line gives a negative time at this frequency.
        """
        known = self._known.get((call, x))
        return known if known is not None else self._compute(call, x)

    def _compute(self, call: str, x: float) -> Price:
        name = _SPIN.get(x, call) if call == "spin_once" else call
        while name not in self._parts and name in WARMER_CALLS:
            name = WARMER_CALLS[name]
        if name in (*BACKGROUND_EVENTS, *SERVICE_CALLS) and name not in self._parts:
            return self._keep(call, x, NO_PRICE)
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
        return self._keep(call, x, self._split(name, constant, variable, x))

    def _keep(self, call: str, x: float, price: Price) -> Price:
        if len(self._known) < _MAX_CACHED:
            self._known[call, x] = price
        return price

    def _split(self, name: str, constant: float, variable: float, x: float) -> Price:
        """Divide the cost of a call between the caller and the background."""
        flags = self._flags(name)
        whole = round(constant + variable)
        if name == "sleep" or name in BACKGROUND_EVENTS:  # a sleep's cost falls while it sleeps
            return Price(0, whole, flags)
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
