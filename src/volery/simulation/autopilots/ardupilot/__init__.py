"""Simulated ArduPilot, Copter and Rover, in the versions 4.5 (4.5.6) and 4.8 (4.8.0-dev).

The behaviour follows recordings of the firmware's own simulator.
"""

from volery.simulation.autopilots.ardupilot.copter import copter
from volery.simulation.autopilots.ardupilot.rover import rover
from volery.simulation.autopilots.ardupilot.versions import VERSIONS
from volery.simulation.autopilots.autopilot import FirmwareFamily

_KINDS = {
    name: {"multirotor": copter(version), "rover": rover(version)} for name, version in VERSIONS.items()
}

FIRMWARE = FirmwareFamily("ardupilot", [*_KINDS.values()][-1], versions=_KINDS, airframes=True)
"""Entry point of the firmware, by kind of vehicle."""

__all__ = ["FIRMWARE"]
