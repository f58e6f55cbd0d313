"""Simulated ArduPilot, Copter and Rover, in the versions 4.5 (4.5.6) and 4.8 (4.8.0-dev).

The behaviour follows recordings of the firmware's own simulator. A firmware is a core and the features that
``features.py`` lists.
"""

from collections.abc import Mapping
from functools import cache

from volery.simulation.autopilots.ardupilot.copter import copter
from volery.simulation.autopilots.ardupilot.features import OPTIONAL
from volery.simulation.autopilots.ardupilot.rover import rover
from volery.simulation.autopilots.ardupilot.versions import VERSIONS
from volery.simulation.autopilots.autopilot import Firmware, FirmwareFamily


@cache
def _kinds(optional: frozenset[str]) -> Mapping[str, Mapping[str, Firmware]]:
    """Return the firmwares with some optional features, by version and kind of vehicle."""
    return {
        name: {"multirotor": copter(version, optional), "rover": rover(version, optional)}
        for name, version in VERSIONS.items()
    }


_DEFAULT = _kinds(frozenset())
FIRMWARE = FirmwareFamily(
    "ardupilot",
    [*_DEFAULT.values()][-1],
    versions=_DEFAULT,
    airframes=True,
    optional=OPTIONAL,
    with_optional=_kinds,
)
"""Entry point of the firmware, by kind of vehicle."""

__all__ = ["FIRMWARE"]
