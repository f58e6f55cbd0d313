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

from pydantic import model_validator

from volery.base.warmth import COLD, Warmth
from volery.cost.figures import Line, WithProvenance, line_through

NOT_COUNTED = (
    "ROS service requests, where a law has no figures for them (0.7 ms each were measured for rospy)",
    "ROS parameter, name and time look-ups",
    "ROS discovery and the master",
    "connections, messages received and time spent in spin, where a law has no figures for them",
)
"""What the law leaves out, as phrases for a report."""

ENDINGS = {
    COLD: ("",),
    Warmth(follows=True): ("_next", ""),
    Warmth(often=True): ("_often", ""),
    Warmth(follows=True, often=True): ("_next_often", "_next", ""),
}
"""How the names of a law's figures end; the first one that it has holds. ``publish_next`` is the figure of
``publish`` shortly after the library has sent or received, ``publish_often`` that in loops of some 20 ms."""

BACKGROUND_EVENTS = ("receive", "connect", "accept", "wait")
"""Events beside calls, which cost nothing where a law has no figure.

A message is received; a subscription connects to a publisher; a publisher accepts a subscription's
connection; x microseconds pass in ``spin``.
"""

SERVICE_CALLS = ("call_service", "serve")
"""A request, for its caller and for its server: they cost nothing where a law has no figure."""


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
