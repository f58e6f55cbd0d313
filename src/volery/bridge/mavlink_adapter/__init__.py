"""A link that presents a vehicle without MAVLink as one that uses MAVLink.

The telemetry of the vehicle's driver is encoded as MAVLink messages, and MAVLink commands are executed by the
operations of a ``Drone``. So naming schemes made for MAVLink serve every drone that has a driver.
"""

from volery.bridge.mavlink_adapter.adapter import MavlinkAdapter

__all__ = ["MavlinkAdapter"]
