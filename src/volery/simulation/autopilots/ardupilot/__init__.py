"""ArduPilot 4.5.6, Copter and Rover, as a dialect of the simulated flight stack: as recorded, not as we
think it is.
"""

from volery.simulation.autopilots.ardupilot.copter import COPTER
from volery.simulation.autopilots.ardupilot.rover import ROVER
from volery.simulation.autopilots.firmware import FirmwareFamily

FIRMWARE = FirmwareFamily("ardupilot", {"multirotor": COPTER, "rover": ROVER})
"""The firmware, by kind of vehicle."""

__all__ = ["FIRMWARE"]
