"""Simulated PX4, multirotor and rover, in the versions that ``versions`` lists.

The multirotor follows recordings of the firmware's own simulator.
"""

from volery.simulation.autopilots.autopilot import FirmwareFamily
from volery.simulation.autopilots.fleet_autopilot import DefaultLink
from volery.simulation.autopilots.px4.airframes import copter, rover
from volery.simulation.autopilots.px4.firmware import ONBOARD, STATION
from volery.simulation.autopilots.px4.versions import VERSIONS

DEFAULT_LINKS = (
    DefaultLink("udp://127.0.0.1:14540?from=14580", ONBOARD),
    DefaultLink("udp://127.0.0.1:14550?from=18570", STATION),
)
"""Addresses of the firmware's own simulator: for onboard programs and for ground stations."""

_KINDS = {
    name: {"multirotor": copter(version), "rover": rover(version)} for name, version in VERSIONS.items()
}

FIRMWARE = FirmwareFamily(
    "px4", _KINDS[[*_KINDS][-1]], default_links=DEFAULT_LINKS, versions=_KINDS, airframes=True
)
"""Entry point of the firmware, by kind of vehicle."""

__all__ = ["FIRMWARE"]
