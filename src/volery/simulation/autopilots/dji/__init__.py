"""A DJI aircraft behind the topics and services of its onboard SDK: a dialect of the simulated stack.

The protocol is from public definitions; how the aircraft behaves beyond them is assumed: see ``assumed`` and,
for figures, ``parameters``.
"""

from volery.simulation.autopilots.dji.firmware import COPTER
from volery.simulation.autopilots.firmware import FirmwareFamily

FIRMWARE = FirmwareFamily("dji", {"multirotor": COPTER}, codec=None)
"""The firmware, by kind of vehicle. It has no links: it is reached over a graph."""

__all__ = ["FIRMWARE"]
