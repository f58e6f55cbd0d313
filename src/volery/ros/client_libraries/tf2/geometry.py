"""Rigid transforms: a rotation (w, x, y, z) and a translation in metres, child to parent."""

from __future__ import annotations

from math import acos, sin, sqrt
from typing import Any, NamedTuple

from volery.base.frames import Quaternion, Vector, multiply


class Rigid(NamedTuple):
    """A point p of the child is ``translation`` + ``rotation`` p in the parent."""

    rotation: Quaternion
    translation: Vector

    def point(self, p: Vector) -> Vector:
        """A point of the child in the parent's axes."""
        x, y, z = rotated(self.rotation, p)
        return x + self.translation[0], y + self.translation[1], z + self.translation[2]

    def then(self, outer: Rigid) -> Rigid:
        """This one, then from its parent to the parent of that."""
        return Rigid(multiply(outer.rotation, self.rotation), outer.point(self.translation))

    def inverse(self) -> Rigid:
        """From the parent to the child."""
        back = conjugate(self.rotation)
        x, y, z = rotated(back, self.translation)
        return Rigid(back, (-x, -y, -z))


IDENTITY = Rigid((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def conjugate(q: Quaternion) -> Quaternion:
    """The rotation back."""
    w, x, y, z = q
    return w, -x, -y, -z


def rotated(q: Quaternion, v: Vector) -> Vector:
    """The vector *v*, rotated."""
    _, x, y, z = multiply(multiply(q, (0.0, *v)), conjugate(q))
    return x, y, z


def between(one: Rigid, other: Rigid, part: float) -> Rigid:
    """*part* of the way from one to the other: straight, and along the shortest arc at constant speed."""
    x, y, z = (a + (b - a) * part for a, b in zip(one.translation, other.translation, strict=True))
    dot = sum(a * b for a, b in zip(one.rotation, other.rotation, strict=True))
    sign = -1.0 if dot < 0.0 else 1.0
    angle = acos(min(1.0, abs(dot)))
    if angle == 0.0:
        return Rigid(one.rotation, (x, y, z))
    first, second = sin((1.0 - part) * angle) / sin(angle), sign * sin(part * angle) / sin(angle)
    p, q = one.rotation, other.rotation
    w, i, j, k = (a * first + b * second for a, b in zip(p, q, strict=True))
    return Rigid((w, i, j, k), (x, y, z))


def normal(q: Quaternion) -> Quaternion | None:
    """The quaternion with length 1; ``None`` for one that is no rotation."""
    length = sqrt(sum(part * part for part in q))
    if not 0.0 < length < float("inf"):
        return None
    w, x, y, z = (part / length for part in q)
    return w, x, y, z


def from_transform(transform: Any) -> Rigid:
    """From a ``geometry_msgs/msg/Transform``."""
    t, q = transform.translation, transform.rotation
    return Rigid((q.w, q.x, q.y, q.z), (t.x, t.y, t.z))


def write_transform(transform: Any, rigid: Rigid) -> None:
    """Into a ``geometry_msgs/msg/Transform``."""
    transform.translation.x, transform.translation.y, transform.translation.z = rigid.translation
    turned = transform.rotation
    turned.w, turned.x, turned.y, turned.z = rigid.rotation
