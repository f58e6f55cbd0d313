"""The interpreter: a vehicle whose autopilot does not speak MAVLink, as one that does.

It is a link. What the driver hears is said there in MAVLink's messages, and what is asked for there is done
by the driver's operations. So names that are made for MAVLink serve every drone that a driver flies.
"""

from volery.bridge.mavlink_adapter.adapter import MavlinkAdapter

__all__ = ["MavlinkAdapter"]
