"""Simulated ArduPilot 4.5.6, Copter and Rover.

The behaviour follows recordings of the firmware's own simulator.
"""

from volery.simulation.autopilots.ardupilot.copter import COPTER
from volery.simulation.autopilots.ardupilot.rover import ROVER
from volery.simulation.autopilots.autopilot import FirmwareFamily

FIRMWARE = FirmwareFamily("ardupilot", {"multirotor": COPTER, "rover": ROVER})
"""Entry point of the firmware, by kind of vehicle."""

__all__ = ["FIRMWARE"]
