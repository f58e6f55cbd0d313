"""The battery: an open-circuit voltage that falls with the charge drawn, behind a constant resistance.

* Law: V = OCV(s) - R I, P = V I, hence I = (OCV - sqrt(OCV^2 - 4 R P)) / (2 R) (Thevenin's circuit without
  its RC branch; Tremblay and Dessaint, World Electric Vehicle Journal 3 (2009), name it the static part).
* OCV(s): piecewise linear through the usual rest voltages of a lithium-polymer cell at 25 degrees C, s =
  fraction left.
* Valid: 0 to 40 degrees C, currents up to about 20 C. Sag recovers at once; ageing and self-discharge are
  left out.
* Beyond the battery's largest power (OCV^2 / 4R) the current stays at OCV / 2R: the battery browns out.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

CELL_FULL_VOLTS = 4.2


@njit(cache=False)
def cell_voltage(left: float) -> float:
    """Open-circuit volts of one cell with the fraction *left* of its charge; past 0 it breaks down."""
    if left >= 0.9:
        return 4.06 + (min(left, 1.0) - 0.9) * 1.4
    if left >= 0.5:
        return 3.84 + (left - 0.5) * 0.55
    if left >= 0.2:
        return 3.73 + (left - 0.2) * (11.0 / 30.0)
    if left >= 0.1:
        return 3.61 + (left - 0.1) * 1.2
    if left >= 0.0:
        return 3.0 + left * 6.1
    return max(0.0, 3.0 + left * 60.0)


@njit(cache=False)
def current(open_volts: float, resistance: float, power: float) -> float:
    """Amperes at which the terminals give *power* watts."""
    room = open_volts * open_volts - 4.0 * resistance * power
    if room <= 0.0:
        return 0.5 * open_volts / resistance
    return 2.0 * power / (open_volts + sqrt(room))
