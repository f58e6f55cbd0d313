"""Paparazzi's rotorcraft firmware as a dialect of the simulated flight stack, behind pprzlink 2.0.

The protocol and the firmware's rules are from public definitions; none of it was compared with a flight.
"""

from volery.links.pprzlink_codec import PPRZLINK
from volery.simulation.autopilots.firmware import DefaultLink, FirmwareFamily
from volery.simulation.autopilots.paparazzi.firmware import ROTORCRAFT

GROUND_SEGMENT = DefaultLink("udp://127.0.0.1:4242?from=4243")
"""Paparazzi's ground segment hears aircraft at port 4242 and speaks to their port 4243."""

FIRMWARE = FirmwareFamily(
    "paparazzi", {"multirotor": ROTORCRAFT}, codec=PPRZLINK, default_links=(GROUND_SEGMENT,)
)
"""The firmware. Rovers are built from another firmware, which is not simulated."""

__all__ = ["FIRMWARE"]
