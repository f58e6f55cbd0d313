"""Simulated rotorcraft firmware of Paparazzi behind pprzlink 2.0.

Protocol and rules follow public definitions and recordings of the firmware's own simulator;
``firmware.ASSUMED`` lists what is assumed.
"""

from volery.links.pprzlink_codec import PPRZLINK
from volery.simulation.autopilots.autopilot import FirmwareFamily
from volery.simulation.autopilots.fleet_autopilot import DefaultLink
from volery.simulation.autopilots.paparazzi.firmware import ROTORCRAFT

GROUND_SEGMENT = DefaultLink("udp://127.0.0.1:4242?from=4243")
"""Paparazzi's ground segment receives at port 4242, and sends to port 4243 of the aircraft."""

FIRMWARE = FirmwareFamily(
    "paparazzi", {"multirotor": ROTORCRAFT}, codec=PPRZLINK, default_links=(GROUND_SEGMENT,)
)
"""Entry point of the firmware. Rovers use another firmware, which is not simulated."""

__all__ = ["FIRMWARE"]
