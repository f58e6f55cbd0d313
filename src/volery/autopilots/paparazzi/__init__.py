"""Paparazzi's rotorcraft firmware as a dialect of the simulated flight stack, behind pprzlink 2.0.

The protocol and the firmware's rules are from public definitions; none of it was compared with a flight.
"""

from volery.autopilots.paparazzi.rotorcraft import ROTORCRAFT
from volery.autopilots.simulated.dialect import Family
from volery.links.pprzlink import PPRZLINK

DIALECT = Family("paparazzi", {"multirotor": ROTORCRAFT}, codec=PPRZLINK)
"""The firmware. Rovers are built from another firmware, which is not simulated."""

__all__ = ["DIALECT"]
