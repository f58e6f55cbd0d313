"""What a computer draws.

Law: P = P_idle + k(f) busy, where busy is the number of busy cores (0 to all of them, fractions as an
average) and k(f) = k(f0) f V(f)^2 / (f0 V(f0)^2), the dynamic power of CMOS logic (Chandrakasan, Sheng and
Brodersen, *Low-Power CMOS Digital Design*, IEEE JSSC 27(4), 1992). V is a straight line between the two
stated points and constant outside them. The linear step per busy core is that of Fan, Weber and Barroso
(ISCA 2007).

Validity: CPU-bound work. What runs (vector units, memory) changes it; the figures carry an error band.
"""

from __future__ import annotations

from volery.cost.figure import Figure, Stated


class PowerLaw(Stated):
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
