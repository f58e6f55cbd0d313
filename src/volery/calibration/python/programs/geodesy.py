"""Points on the earth: named tuples, trigonometry, small functions."""

from math import asin, atan2, cos, degrees, pi, radians, sin, sqrt
from random import Random
from typing import NamedTuple

RADIUS = 6371000.0


class Point(NamedTuple):
    latitude: float
    longitude: float
    height: float = 0.0

    def raised(self, by):
        return Point(self.latitude, self.longitude, self.height + by)


def distance(one, other):
    north = radians(other.latitude - one.latitude)
    east = radians(other.longitude - one.longitude)
    half = (
        sin(north / 2) ** 2 + cos(radians(one.latitude)) * cos(radians(other.latitude)) * sin(east / 2) ** 2
    )
    return 2 * RADIUS * asin(sqrt(half))


def bearing(one, other):
    east = radians(other.longitude - one.longitude)
    y = sin(east) * cos(radians(other.latitude))
    x = cos(radians(one.latitude)) * sin(radians(other.latitude))
    x -= sin(radians(one.latitude)) * cos(radians(other.latitude)) * cos(east)
    return degrees(atan2(y, x)) % 360.0


def onward(start, course, length):
    share = length / RADIUS
    latitude = start.latitude + degrees(share * cos(radians(course)))
    longitude = start.longitude + degrees(share * sin(radians(course)) / cos(radians(latitude)))
    return Point(latitude, (longitude + 180.0) % 360.0 - 180.0, start.height)


def prepare(seed):
    random = Random(seed)
    return [
        Point(random.uniform(40, 44), random.uniform(-5, 0), random.uniform(0, 2 * pi)) for _ in range(250)
    ]


def run(state):
    here = state[0]
    total = 0.0
    for point in state[1:]:
        length = distance(here, point)
        here = onward(here, bearing(here, point), min(length, 500.0)).raised(1.0)
        total += length
    return total
