"""What the components of the delivery service tell each other."""

from __future__ import annotations

from dataclasses import dataclass

from volery import Position

IDLE, BUSY, FAILED = "idle", "busy", "failed"
"""What a vehicle can be."""

DONE = "done"
"""How a job ends that succeeded; any other outcome is the reason why it did not."""


@dataclass(frozen=True)
class Receipt:
    """The answer to an order. ``parcel`` is empty if it was turned down, ``reason`` says why."""

    parcel: str
    reason: str = ""


@dataclass(frozen=True)
class VehicleStatus:
    """A vehicle as its controller sees it.

    ``job`` is the job it does, or did last; ``outcome`` is empty while that goes on. ``battery`` is 0..1.
    """

    vehicle: str
    state: str
    job: str
    outcome: str
    position: Position
    battery: float


@dataclass(frozen=True)
class Offset:
    """Where a beacon is, seen from the vehicle: metres east and north, and how far below."""

    east: float
    north: float
    below: float
