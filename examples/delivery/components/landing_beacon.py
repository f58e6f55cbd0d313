"""A beacon on a landing pad, and how a camera sees it: with noise, and only from above."""

from __future__ import annotations

import random
from math import hypot

from delivery_types import Offset

RANGE_M = 30.0
CONE = 0.6
"""The camera sees what is within this many metres to the side for each metre below it."""
NEAR_M = 2.0
"""So close to the beacon it is seen from this far to the side as well."""

NOISE_M = 0.02
NOISE_PER_METRE = 0.01
"""Standard deviation of an offset: a part that stays and a part that grows with the distance."""


class LandingBeacon:
    """Part of the environment: it has the true position of the vehicle, which is not available on board."""

    def __init__(self, body, city, pad_east_m=0.0):
        self._body = body
        self._frame = city.origin
        self._pads = [(port.east_m + pad_east_m, port.north_m) for port in city.places_with("port")]

    def look(self):
        """Where the nearest beacon is seen, ``None`` if none is."""
        position = self._body.position
        east, north, up = self._frame.to_enu(position.latitude, position.longitude, position.altitude.metres)
        pad = min(self._pads, key=lambda place: hypot(place[0] - east, place[1] - north))
        offset = Offset(pad[0] - east, pad[1] - north, up)
        if up > RANGE_M or hypot(offset.east, offset.north) > NEAR_M + CONE * max(0.0, up):
            return None
        spread = NOISE_M + NOISE_PER_METRE * max(0.0, up)
        return Offset(
            offset.east + random.gauss(0.0, spread),
            offset.north + random.gauss(0.0, spread),
            offset.below + random.gauss(0.0, spread),
        )
