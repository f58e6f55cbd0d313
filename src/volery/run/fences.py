"""The no-fly zones of a model as the fence of every drone that its components command."""

from __future__ import annotations

from math import isinf

from volery.base.position import AMSL
from volery.model.environment import Environment, Prism
from volery.vehicles import Fence, Zone


def fence_of(environment: Environment) -> Fence | None:
    """Out of every no-fly zone; ``None`` if there is none. Checked before a command and on the way."""
    if not environment.no_fly_zones:
        return None
    return Fence(no_fly=tuple(_zone(prism, environment) for prism in environment.no_fly_zones))


def _zone(prism: Prism, environment: Environment) -> Zone:
    """A zone from the ground up has no floor: a drone that stands a little lower is still in it."""
    origin = environment.origin
    places = [origin.from_enu((east, north, 0.0)) for east, north in prism.corners]
    return Zone(
        prism.name,
        tuple((latitude, longitude) for latitude, longitude, _ in places),
        AMSL(origin.amsl + prism.floor_m) if prism.floor_m > 0.0 else None,
        None if isinf(prism.ceiling_m) else AMSL(origin.amsl + prism.ceiling_m),
    )
