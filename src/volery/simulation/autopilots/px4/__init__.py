"""PX4 1.14.0, multirotor and rover, as a dialect of the simulated flight stack: as recorded, not as we think
it is.
"""

from volery.simulation.autopilots.firmware import DefaultLink, FirmwareFamily
from volery.simulation.autopilots.px4.copter import COPTER
from volery.simulation.autopilots.px4.firmware import ONBOARD, STATION
from volery.simulation.autopilots.px4.rover import ROVER

DEFAULT_LINKS = (DefaultLink("udp://127.0.0.1:14540", ONBOARD), DefaultLink("udp://127.0.0.1:14550", STATION))
"""As the firmware's own simulator has them: for programs, and for ground stations."""

FIRMWARE = FirmwareFamily("px4", {"multirotor": COPTER, "rover": ROVER}, default_links=DEFAULT_LINKS)
"""The firmware, by kind of vehicle."""

__all__ = ["FIRMWARE"]
