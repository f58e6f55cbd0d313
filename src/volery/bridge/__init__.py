"""The bridge: one vehicle on the graph, under MAVROS's names, roscopter's or pprzros's.

Knows the graph, messages and links (frames as values); translates between them as those do, and
no more: it waits for nothing to be done and repeats no command. Where an autopilot does not speak MAVLink,
the interpreter stands between it and the names that do. It must not know worlds, simulated autopilots or any
one driver.
"""

from volery.bridge.mavlink_adapter import MavlinkAdapter
from volery.bridge.mavros_names import MAVROS
from volery.bridge.node_interface import NamingScheme
from volery.bridge.pprzros_node import PprzrosNode, serve_pprzros
from volery.bridge.roscopter_names import ROSCOPTER
from volery.bridge.vehicle_node import VehicleNode, VehicleNodeOptions, serve_vehicle

__all__ = [
    "MAVROS",
    "ROSCOPTER",
    "MavlinkAdapter",
    "NamingScheme",
    "PprzrosNode",
    "VehicleNode",
    "VehicleNodeOptions",
    "serve_pprzros",
    "serve_vehicle",
]
