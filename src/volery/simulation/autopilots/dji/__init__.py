"""Simulated DJI aircraft behind the topics and services of its onboard SDK.

The protocol follows public definitions. All other behaviour is assumed: see ``firmware.ASSUMED`` and
``parameters``.
"""

from volery.simulation.autopilots.autopilot import FirmwareFamily
from volery.simulation.autopilots.dji.firmware import COPTER

FIRMWARE = FirmwareFamily("dji", {"multirotor": COPTER}, codec=None)
"""Entry point of the firmware. There is no codec: the aircraft is reached over a ROS graph."""

__all__ = ["FIRMWARE"]
