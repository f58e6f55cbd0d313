"""What every number of the catalogue carries: where it comes from.

What a computer draws.

Law: P = P_idle + k(f) busy, where busy is the number of busy cores (0 to all of them, fractions as an
average) and k(f) = k(f0) f V(f)^2 / (f0 V(f0)^2), the dynamic power of CMOS logic (Chandrakasan, Sheng and
Brodersen, *Low-Power CMOS Digital Design*, IEEE JSSC 27(4), 1992). V is a straight line between the two
stated points and constant outside them. The linear step per busy core is that of Fan, Weber and Barroso
(ISCA 2007).

Validity: CPU-bound work. What runs (vector units, memory) changes it; the figures carry an error band.

Figures stated at one frequency, at another one.

Law: the same processor executes the same instructions in the same number of cycles, so time ~ 1/f, and the
energy of an operation ~ V(f)^2 (see ``energy``). Source: the cycle-count view of MARTE's GQAM (``execTime``
over the speed factor of the host). Validity: work bound by the core; memory-bound work gains less from a
higher frequency, so the law is then optimistic upward and pessimistic downward. On another kind of processor
it says nothing: that needs its own figure.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from volery.base.errors import EstimateError
from volery.base.time import Ns

Provenance = Literal["estimated", "measured", "calculated", "required"]


class WithProvenance(BaseModel):
    """Something somebody stated: how it came about, who says so, and where it holds."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    provenance: Provenance
    source: str
    validity: str = ""
    note: str = ""


class Figure(WithProvenance):
    """One number. ``error`` is its honest relative band (0.2: within 20 per cent), ``None`` where unknown."""

    value: float
    error: float | None = None


class Line(BaseModel):
    """A quantity that is a straight line over the frequency: ``slope`` times frequency plus ``offset``."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    offset: float
    per_mhz: float = 0.0
    per_ghz: float = 0.0

    def at(self, frequency_mhz: float) -> float:
        """Its value at a frequency."""
        return (self.per_mhz + self.per_ghz / 1000.0) * frequency_mhz + self.offset


def line_through(points: dict[float, float]) -> Line:
    """The line through two points (frequency in MHz, value)."""
    (low, at_low), (high, at_high) = sorted(points.items())
    slope = (at_high - at_low) / (high - low)
    return Line(per_mhz=slope, offset=at_low - slope * low)


class PowerLaw(WithProvenance):
    """Watts of one kind of processor, taken at its supply. ``volts`` maps MHz to core volts (two points)."""

    idle_w: Figure
    busy_core_w: Figure
    busy_core_at_mhz: float
    volts: dict[float, float]

    def core_w(self, frequency_mhz: float) -> float:
        """What one busy core draws on top of idle, watts."""
        ratio = self._volts(frequency_mhz) / self._volts(self.busy_core_at_mhz)
        return self.busy_core_w.value * frequency_mhz / self.busy_core_at_mhz * ratio * ratio

    def watts(self, busy_cores: float, frequency_mhz: float) -> float:
        """What the computer draws with so many cores busy, watts."""
        return self.idle_w.value + busy_cores * self.core_w(frequency_mhz)

    def joules(self, busy_core_s: float, elapsed_s: float, frequency_mhz: float) -> float:
        """Energy of *elapsed_s* seconds in which the cores were busy for *busy_core_s* seconds together."""
        return self.idle_w.value * elapsed_s + self.core_w(frequency_mhz) * busy_core_s

    def band(self) -> float:
        """The larger of its figures' relative errors."""
        return max(self.idle_w.error or 0.0, self.busy_core_w.error or 0.0)

    def how_good(self) -> str:
        """The band in words."""
        return f"within {self.band():.0%}" if self.band() else "its error is not known"

    def cycle_ratio(self, stated_mhz: float, frequency_mhz: float) -> float:
        """Energy of one clock cycle at *frequency_mhz* over that at *stated_mhz*.

        The voltages' ratio squared.
        """
        ratio = self._volts(frequency_mhz) / self._volts(stated_mhz)
        return ratio * ratio

    def _volts(self, frequency_mhz: float) -> float:
        (low, at_low), (high, at_high) = sorted(self.volts.items())
        share = (min(max(frequency_mhz, low), high) - low) / (high - low)
        return at_low + share * (at_high - at_low)


def scale_time(time: Ns, stated: tuple[str, float], wanted: tuple[str, float]) -> Ns:
    """*time* stated at (kind of processor, MHz), at (kind, MHz) *wanted*.

    ``EstimateError`` for another kind.
    """
    _same_kind(stated[0], wanted[0])
    _positive(stated[1], wanted[1])
    return round(time * stated[1] / wanted[1])


def scale_energy(
    joules: float, stated: tuple[str, float], wanted: tuple[str, float], power: PowerLaw
) -> float:
    """*joules* of one operation, scaled like ``scale_time``; *power* is the law of that kind of processor."""
    _same_kind(stated[0], wanted[0])
    _positive(stated[1], wanted[1])
    return joules * power.cycle_ratio(stated[1], wanted[1])


def _same_kind(stated: str, wanted: str) -> None:
    if stated != wanted:
        raise EstimateError(
            f"a figure stated for {stated} says nothing about {wanted}: state one for {wanted} as well"
        )


def _positive(*frequencies_mhz: float) -> None:
    for frequency in frequencies_mhz:
        if not frequency > 0.0:
            raise EstimateError(f"a frequency of {frequency:g} MHz: state one above zero")
