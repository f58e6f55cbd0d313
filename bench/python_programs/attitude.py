"""Quaternions: integrate body rates and rotate vectors."""

from math import cos, sin, sqrt
from random import Random
from typing import NamedTuple


class Quaternion(NamedTuple):
    w: float
    x: float
    y: float
    z: float

    def times(self, o):
        return Quaternion(
            self.w * o.w - self.x * o.x - self.y * o.y - self.z * o.z,
            self.w * o.x + self.x * o.w + self.y * o.z - self.z * o.y,
            self.w * o.y - self.x * o.z + self.y * o.w + self.z * o.x,
            self.w * o.z + self.x * o.y - self.y * o.x + self.z * o.w,
        )

    def conjugate(self):
        return Quaternion(self.w, -self.x, -self.y, -self.z)

    def unit(self):
        size = sqrt(self.w**2 + self.x**2 + self.y**2 + self.z**2)
        return Quaternion(self.w / size, self.x / size, self.y / size, self.z / size)

    def rotate(self, vector):
        turned = self.times(Quaternion(0.0, *vector)).times(self.conjugate())
        return turned.x, turned.y, turned.z


def turn(rates, dt):
    p, q, r = rates
    angle = sqrt(p * p + q * q + r * r) * dt
    if angle < 1e-9:
        return Quaternion(1.0, 0.0, 0.0, 0.0)
    share = sin(angle / 2) / (angle / dt)
    return Quaternion(cos(angle / 2), p * share, q * share, r * share)


def prepare(seed):
    random = Random(seed)
    return [tuple(random.gauss(0, 1) for _ in range(3)) for _ in range(700)]


def run(state):
    attitude = Quaternion(1.0, 0.0, 0.0, 0.0)
    velocity = [0.0, 0.0, 0.0]
    for rates in state:
        attitude = attitude.times(turn(rates, 0.01)).unit()
        pushed = attitude.rotate((0.0, 0.0, 9.81))
        velocity = [v + 0.01 * a for v, a in zip(velocity, pushed, strict=True)]
    return attitude, velocity
