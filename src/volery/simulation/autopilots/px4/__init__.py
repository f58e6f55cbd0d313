"""Simulated PX4 1.14.0, multirotor and rover.

The multirotor follows recordings of the firmware's own simulator.
"""

from volery.simulation.autopilots.autopilot import DefaultLink, FirmwareFamily
from volery.simulation.autopilots.px4.airframes import COPTER, ROVER
from volery.simulation.autopilots.px4.firmware import ONBOARD, STATION

DEFAULT_LINKS = (
    DefaultLink("udp://127.0.0.1:14540?from=14580", ONBOARD),
    DefaultLink("udp://127.0.0.1:14550?from=18570", STATION),
)
"""Addresses of the firmware's own simulator: for onboard programs and for ground stations."""

FIRMWARE = FirmwareFamily("px4", {"multirotor": COPTER, "rover": ROVER}, default_links=DEFAULT_LINKS)
"""Entry point of the firmware, by kind of vehicle."""

__all__ = ["FIRMWARE"]
