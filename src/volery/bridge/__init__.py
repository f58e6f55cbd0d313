"""The bridge: one vehicle on the graph, under MAVROS's names, roscopter's or pprzros's.

Knows the graph, messages and links (frames as values); translates between them as those do, and
no more: it waits for nothing to be done and repeats no command. It must not know worlds, simulated
autopilots or drivers.
"""

from volery.bridge.mavros import MAVROS
from volery.bridge.offering import Names
from volery.bridge.pprzros import PprzrosNode, serve_pprzros
from volery.bridge.roscopter import ROSCOPTER
from volery.bridge.vehicle_node import VehicleNode, VehicleNodeOptions, serve_vehicle

__all__ = [
    "MAVROS",
    "ROSCOPTER",
    "Names",
    "PprzrosNode",
    "VehicleNode",
    "VehicleNodeOptions",
    "serve_pprzros",
    "serve_vehicle",
]
