"""The flying API: vehicles with blocking operations, and what a driver of an autopilot is."""

from volery.vehicles.driver import (
    Capability,
    ChangeSpeed,
    Driver,
    DriverFactory,
    Land,
    MissionItem,
    ReturnHome,
    TakeOff,
    Waypoint,
    drivers,
)
from volery.vehicles.drone import Drone
from volery.vehicles.escalation import Escalation, Reaction
from volery.vehicles.fleet import Fleet
from volery.vehicles.limits import Fence, Limits, Zone
from volery.vehicles.rover import Rover
from volery.vehicles.telemetry import Attitude, Battery, StatusText, Velocity
from volery.vehicles.vehicle import Vehicle

__all__ = [
    "Attitude",
    "Battery",
    "Capability",
    "ChangeSpeed",
    "Driver",
    "DriverFactory",
    "Drone",
    "Escalation",
    "Fence",
    "Fleet",
    "Land",
    "Limits",
    "MissionItem",
    "Reaction",
    "ReturnHome",
    "Rover",
    "StatusText",
    "TakeOff",
    "Vehicle",
    "Velocity",
    "Waypoint",
    "Zone",
    "drivers",
]
