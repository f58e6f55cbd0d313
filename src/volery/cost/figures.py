"""Figures with provenance, and the two laws that carry a figure to another frequency: time and power.

Time: the same processor executes the same instructions in the same number of cycles, so time ~ 1/f, and the
energy of an operation ~ V(f)^2. Source: the cycle-count view of MARTE's GQAM (``execTime`` over the speed
factor of the host). Validity: work bound by the core. Memory-bound work gains less from a higher frequency,
so the law is then optimistic upward and pessimistic downward. Between kinds of processors there is no such
law: each needs its own figure.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from volery.base.errors import EstimateError
from volery.base.time import Ns

Provenance = Literal["estimated", "measured", "calculated", "required"]


class WithProvenance(BaseModel):
    """Base of all figures and laws: how they were obtained, from which source, where they are valid."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    provenance: Provenance
    source: str
    validity: str = ""
    note: str = ""


class Figure(WithProvenance):
    """One number. ``error`` is its relative error band (0.2: within 20 %), None where it is not known."""

    value: float
    error: float | None = None


class Line(BaseModel):
    """A quantity that is linear in the frequency: slope times frequency plus ``offset``."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    offset: float
    per_mhz: float = 0.0
    per_ghz: float = 0.0

    def at(self, frequency_mhz: float) -> float:
        """Return the value at a frequency in MHz."""
        return (self.per_mhz + self.per_ghz / 1000.0) * frequency_mhz + self.offset


def line_through(points: dict[float, float]) -> Line:
    """Return the line through two points {frequency in MHz: value}."""
    (low, at_low), (high, at_high) = sorted(points.items())
    slope = (at_high - at_low) / (high - low)
    return Line(per_mhz=slope, offset=at_low - slope * low)


class PowerLaw(WithProvenance):
    """Electrical power of one kind of processor, taken at its supply.

    Law: P = P_idle + k(f) busy, where busy is the number of busy cores (fractions as an average) and
    k(f) = k(f0) f V(f)^2 / (f0 V(f0)^2), the dynamic power of CMOS logic (Chandrakasan, Sheng and Brodersen,
    *Low-Power CMOS Digital Design*, IEEE JSSC 27(4), 1992). V is a straight line between the two stated
    points and constant outside them. The linear step per busy core is that of Fan, Weber and Barroso (ISCA
    2007). Validity: CPU-bound work; vector units and memory change it, and the figures carry an error band.

    Attributes:
        idle_w: Power with no core busy, W.
        busy_core_w: Additional power of one busy core at ``busy_core_at_mhz``, W.
        volts: Core voltage at two frequencies, {MHz: V}.
    """

    idle_w: Figure
    busy_core_w: Figure
    busy_core_at_mhz: float
    volts: dict[float, float]

    def core_w(self, frequency_mhz: float) -> float:
        """Return the power of one busy core on top of idle, W."""
        ratio = self._volts(frequency_mhz) / self._volts(self.busy_core_at_mhz)
        return self.busy_core_w.value * frequency_mhz / self.busy_core_at_mhz * ratio * ratio

    def watts(self, busy_cores: float, frequency_mhz: float) -> float:
        """Return the power with ``busy_cores`` cores busy, W."""
        return self.idle_w.value + busy_cores * self.core_w(frequency_mhz)

    def joules(self, busy_core_s: float, elapsed_s: float, frequency_mhz: float) -> float:
        """Return the energy of ``elapsed_s`` seconds with ``busy_core_s`` core-seconds of work, J."""
        return self.idle_w.value * elapsed_s + self.core_w(frequency_mhz) * busy_core_s

    def band(self) -> float:
        """Return the larger of the figures' relative errors, 0 where they are not known."""
        return max(self.idle_w.error or 0.0, self.busy_core_w.error or 0.0)

    def how_good(self) -> str:
        """Return the error band as a phrase."""
        return f"within {self.band():.0%}" if self.band() else "its error is not known"

    def cycle_ratio(self, stated_mhz: float, frequency_mhz: float) -> float:
        """Return the energy of a clock cycle at ``frequency_mhz`` over that at ``stated_mhz``.

        It is the square of the ratio of voltages.
        """
        ratio = self._volts(frequency_mhz) / self._volts(stated_mhz)
        return ratio * ratio

    def _volts(self, frequency_mhz: float) -> float:
        (low, at_low), (high, at_high) = sorted(self.volts.items())
        share = (min(max(frequency_mhz, low), high) - low) / (high - low)
        return at_low + share * (at_high - at_low)


def scale_time(time: Ns, stated: tuple[str, float], wanted: tuple[str, float]) -> Ns:
    """Scale an execution time to another frequency of the same kind of processor.

    Args:
        time: Execution time, ns.
        stated: Kind of processor and frequency in MHz that the time is stated at.
        wanted: Kind of processor and frequency in MHz to scale to.

    Raises:
        EstimateError: The kinds differ, or a frequency is not above zero.
    """
    _check_scaling(stated, wanted)
    return round(time * stated[1] / wanted[1])


def scale_energy(
    joules: float, stated: tuple[str, float], wanted: tuple[str, float], power: PowerLaw
) -> float:
    """Scale the energy of an operation, J, as ``scale_time`` does; ``power`` is the law of that kind."""
    _check_scaling(stated, wanted)
    return joules * power.cycle_ratio(stated[1], wanted[1])


def _check_scaling(stated: tuple[str, float], wanted: tuple[str, float]) -> None:
    kind, other = stated[0], wanted[0]
    if kind != other:
        raise EstimateError(
            f"a figure stated for {kind} says nothing about {other}: state one for {other} as well"
        )
    for _, frequency in (stated, wanted):
        if not frequency > 0.0:
            raise EstimateError(f"a frequency of {frequency:g} MHz: state one above zero")
