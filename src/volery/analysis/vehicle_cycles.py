"""What the node that serves a vehicle executes at most, from its loop and its names.

The node of ``volery.bridge`` has a loop. In each cycle it publishes of every topic the latest message, so the
topics of its names limit its messages; under an autopilot's own names, where frames are published as they
arrive, a cycle is the shortest period of the frames that it requests; a pprzros node publishes all frames
that wait, whose number its queue limits. A simulated copter in flight has 11 messages in its fullest cycle, a
rover 8.
"""

from __future__ import annotations

from dataclasses import dataclass

from volery.base.time import Ns, S
from volery.bridge.ardupilot_interface import TOPIC_COUNT
from volery.bridge.naming_schemes import MAVLINK_SCHEMES, MAVROS_TOPICS, ROSCOPTER_TOPICS
from volery.bridge.px4_telemetry import OUTPUTS as PX4_OUTPUTS
from volery.bridge.vehicle_node import MAX_WAITING, PPRZROS_PERIOD, VehicleNodeOptions
from volery.run.assembly.vehicle_nodes import ROSCOPTER_NAMES, own_names
from volery.simulation.autopilots.fleet_autopilot import firmwares

REQUESTS = 8
"""Set-points and requests of one commander in a cycle that are counted, at most."""


@dataclass(frozen=True)
class Cycle:
    """The most that a node does in a cycle: messages published, and requests of each commander served."""

    period: Ns
    messages: int
    requests: int = REQUESTS


def cycle_of(autopilot: str, names: str) -> Cycle | None:
    """Return the cycle of the node of a vehicle with this *autopilot*.

    None where the autopilot is a node itself.

    Args:
        autopilot: Its name in a model.
        names: Whose names the node has; empty for MAVROS's.
    """
    codec = firmwares.load(autopilot).codec
    if codec is None:
        return None
    if codec.name == "pprzlink":
        return Cycle(PPRZROS_PERIOD, MAX_WAITING)
    if own_names(names):
        fastest = max(MAVLINK_SCHEMES[names].messages.values())
        return Cycle(round(S / fastest), max(len(PX4_OUTPUTS), TOPIC_COUNT))
    topics = ROSCOPTER_TOPICS if names == ROSCOPTER_NAMES else MAVROS_TOPICS
    period = VehicleNodeOptions().period
    assert period is not None
    return Cycle(period, len(topics))
