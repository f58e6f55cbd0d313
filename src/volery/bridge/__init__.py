"""The bridge: one vehicle on the graph, under MAVROS's names.

Knows the graph, messages and links (MAVLink frames as values); translates between them as MAVROS does, and
no more: it waits for nothing to be done and repeats no command. It must not know worlds, simulated
autopilots or drivers.
"""

from volery.bridge.vehicle_node import VehicleNode, VehicleNodeOptions, serve_vehicle

__all__ = ["VehicleNode", "VehicleNodeOptions", "serve_vehicle"]
