"""What the rotorcraft firmware keeps about its vehicle beyond what all firmwares do."""

from __future__ import annotations

from dataclasses import dataclass, field

from volery.base.time import Ns
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.paparazzi.navigation import Navigation
from volery.simulation.autopilots.paparazzi.radio import Radio
from volery.simulation.autopilots.vehicle_state import Vehicle


@dataclass
class Memory:
    """``Vehicle.memory`` of a Paparazzi rotorcraft."""

    navigation: Navigation
    radio: Radio = field(default_factory=Radio)
    refused: int | None = None
    """Arming status of the last wish for motors that was refused."""
    fix_seen: Ns = NEVER
    """When the receiver last had a 3-D fix."""
    uplink_at: Ns = NEVER
    """When the ground was last heard."""
    uplink_messages: int = 0
    downlink_messages: int = 0
    shown_waypoint: int = 0
    """The last one that was sent because its turn had come; likewise of settings."""
    shown_setting: int = -1


def of(vehicle: Vehicle) -> Memory:
    """What is kept about *vehicle*."""
    kept = vehicle.memory
    assert isinstance(kept, Memory)
    return kept
