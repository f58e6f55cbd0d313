"""What every number of the catalogue carries: where it comes from."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

Provenance = Literal["estimated", "measured", "calculated", "required"]


class Stated(BaseModel):
    """Something somebody stated: how it came about, who says so, and where it holds."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    provenance: Provenance
    source: str
    validity: str = ""
    note: str = ""


class Figure(Stated):
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


def through(points: dict[float, float]) -> Line:
    """The line through two points (frequency in MHz, value)."""
    (low, at_low), (high, at_high) = sorted(points.items())
    slope = (at_high - at_low) / (high - low)
    return Line(per_mhz=slope, offset=at_low - slope * low)
