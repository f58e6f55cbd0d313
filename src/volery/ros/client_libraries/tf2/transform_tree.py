"""A tree of coordinate frames whose transforms change over time, with tf2's lookups and exceptions.

A rigid transform is a rotation quaternion (w, x, y, z) and a translation in metres, from child to parent.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Iterator
from math import sqrt
from typing import Any, NamedTuple

from volery.base.elementary import acos, sin
from volery.base.frames import Quaternion, Vector, multiply
from volery.base.time import Ns, S, to_seconds

# -- exceptions


class TransformException(Exception):  # noqa: N818 - tf2's name
    """Base class of tf2's exceptions."""


class LookupException(TransformException):
    """A frame is unknown."""


class ConnectivityException(TransformException):
    """Two frames are not connected."""


class ExtrapolationException(TransformException):
    """A time is before or after all known transforms."""


class InvalidArgumentException(TransformException):
    """A frame name or a rotation is invalid."""


class TimeoutException(TransformException):
    """A wait has timed out."""


EXCEPTIONS = {
    kind.__name__: kind
    for kind in (
        TransformException,
        LookupException,
        ConnectivityException,
        ExtrapolationException,
        InvalidArgumentException,
        TimeoutException,
    )
}


# -- rigid transforms


class RigidTransform(NamedTuple):
    """A transform that takes a point p of the child to ``rotation`` p + ``translation`` in the parent."""

    rotation: Quaternion
    translation: Vector

    def point(self, p: Vector) -> Vector:
        """Return a point of the child in the axes of the parent."""
        x, y, z = rotated(self.rotation, p)
        return x + self.translation[0], y + self.translation[1], z + self.translation[2]

    def then(self, outer: RigidTransform) -> RigidTransform:
        """Return this transform followed by *outer*, the transform of the parent to its own parent."""
        return RigidTransform(multiply(outer.rotation, self.rotation), outer.point(self.translation))

    def inverse(self) -> RigidTransform:
        """Return the transform from parent to child."""
        back = conjugate(self.rotation)
        x, y, z = rotated(back, self.translation)
        return RigidTransform(back, (-x, -y, -z))


IDENTITY = RigidTransform((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def conjugate(q: Quaternion) -> Quaternion:
    """Return the inverse of a unit quaternion."""
    w, x, y, z = q
    return w, -x, -y, -z


def rotated(q: Quaternion, v: Vector) -> Vector:
    """Return *v* rotated by the unit quaternion *q*."""
    _, x, y, z = multiply(multiply(q, (0.0, *v)), conjugate(q))
    return x, y, z


def interpolate(one: RigidTransform, other: RigidTransform, part: float) -> RigidTransform:
    """Return the transform at *part* (0..1) between two: linear translation, spherical linear rotation."""
    x, y, z = (a + (b - a) * part for a, b in zip(one.translation, other.translation, strict=True))
    dot = sum(a * b for a, b in zip(one.rotation, other.rotation, strict=True))
    sign = -1.0 if dot < 0.0 else 1.0
    angle = acos(min(1.0, abs(dot)))
    if angle == 0.0:
        return RigidTransform(one.rotation, (x, y, z))
    first, second = sin((1.0 - part) * angle) / sin(angle), sign * sin(part * angle) / sin(angle)
    p, q = one.rotation, other.rotation
    w, i, j, k = (a * first + b * second for a, b in zip(p, q, strict=True))
    return RigidTransform((w, i, j, k), (x, y, z))


def normalised(q: Quaternion) -> Quaternion | None:
    """Return the quaternion with length 1, or None if its length is zero or not finite."""
    length = sqrt(sum(part * part for part in q))
    if not 0.0 < length < float("inf"):
        return None
    w, x, y, z = (part / length for part in q)
    return w, x, y, z


def from_transform(transform: Any) -> RigidTransform:
    """Return the transform in a ``geometry_msgs/msg/Transform``."""
    t, q = transform.translation, transform.rotation
    return RigidTransform((q.w, q.x, q.y, q.z), (t.x, t.y, t.z))


def write_transform(transform: Any, rigid: RigidTransform) -> None:
    """Write *rigid* into a ``geometry_msgs/msg/Transform``."""
    transform.translation.x, transform.translation.y, transform.translation.z = rigid.translation
    rotation = transform.rotation
    rotation.w, rotation.x, rotation.y, rotation.z = rigid.rotation


# -- the tree

LATEST: Ns = 0
"""The time that stands for the latest time at which a transform is available."""
_CACHE: Ns = 10 * S


class _Sample(NamedTuple):
    at: Ns
    parent: str
    rigid: RigidTransform


class TransformTree:
    """Frames and their transforms to their parents.

    Samples of a frame that are older than its newest one by more than *cache* are removed. A static transform
    is valid at all times.
    """

    def __init__(self, cache: Ns = _CACHE) -> None:
        self._cache = cache
        self._moving: dict[str, list[_Sample]] = {}
        self._static: dict[str, _Sample] = {}
        self._parents: dict[str, None] = {}

    def clear(self) -> None:
        """Remove all transforms but the static ones."""
        self._moving.clear()

    def frames(self) -> list[str]:
        """Return the names of all frames, sorted."""
        return sorted({*self._parents, *self._moving, *self._static})

    def add(self, child: str, parent: str, at: Ns, rigid: RigidTransform, *, static: bool = False) -> None:
        """Add the transform from *child* to *parent* at a time.

        Raises:
            InvalidArgumentException: A frame name is invalid, or the rotation has no length.
        """
        rotation = normalised(rigid.rotation)
        problem = _problem(child, parent) or ("" if rotation else "its rotation has no length")
        if problem or rotation is None:
            raise InvalidArgumentException(f"transform from {child!r} to {parent!r} ignored: {problem}")
        sample = _Sample(at, parent, RigidTransform(rotation, rigid.translation))
        self._parents[parent] = None
        if static:
            self._static[child] = sample
            return
        history = self._moving.setdefault(child, [])
        if history and at < history[-1].at - self._cache:
            return
        history[:] = [one for one in history if one.at != at]
        insort(history, sample, key=_time)
        del history[: bisect_left(history, history[-1].at - self._cache, key=_time)]

    def look_up(self, target: str, source: str, at: Ns) -> tuple[Ns, RigidTransform]:
        """Return the transform from *source* to *target* and the time for which it is valid.

        Args:
            target: Frame to transform to.
            source: Frame to transform from.
            at: ROS time in ns, or ``LATEST``.

        Raises:
            LookupException: A frame is unknown.
            ConnectivityException: The frames are not connected.
            ExtrapolationException: The time is before or after all known transforms.
        """
        known = self.frames()
        for name, role in ((target, "target_frame"), (source, "source_frame")):
            if name not in known:
                raise LookupException(
                    f'"{name}" passed to lookupTransform argument {role} does not exist. '
                    f"There is {', '.join(known) or 'none'}"
                )
        up, down = self._paths(target, source)
        if at == LATEST:
            # The latest time for which all moving transforms on the path are known.
            last = [self._moving[frame][-1].at for frame in (*up, *down) if self._moving.get(frame)]
            at = min(last, default=LATEST)
        try:
            there, back = self._along(up, at), self._along(down, at)
        except ExtrapolationException as error:
            raise ExtrapolationException(
                f"{error}, when looking up transform from frame [{source}] to frame [{target}]"
            ) from None
        return at, there.then(back.inverse())

    def _paths(self, target: str, source: str) -> tuple[list[str], list[str]]:
        """Return the frames below the first common ancestor, from the source and from the target."""
        from_source, from_target = list(self._upward(source)), list(self._upward(target))
        common = next((frame for frame in from_source if frame in from_target), None)
        if common is None:
            raise ConnectivityException(
                f"Could not find a connection between '{target}' and '{source}' because they are not part of "
                f"the same tree. Tf has two or more unconnected trees."
            )
        return from_source[: from_source.index(common)], from_target[: from_target.index(common)]

    def _upward(self, frame: str) -> Iterator[str]:
        seen: set[str] = set()
        while frame not in seen:
            seen.add(frame)
            yield frame
            history = self._moving.get(frame)
            newest = history[-1] if history else self._static.get(frame)
            if newest is None:
                return
            frame = newest.parent

    def _along(self, path: list[str], at: Ns) -> RigidTransform:
        found = IDENTITY
        for frame in path:
            found = found.then(self._at(frame, at))
        return found

    def _at(self, frame: str, at: Ns) -> RigidTransform:
        history = self._moving.get(frame)
        if not history:
            return self._static[frame].rigid
        after = bisect_left(history, at, key=_time)
        if after < len(history) and history[after].at == at:
            return history[after].rigid
        if after == len(history):
            raise _extrapolation(at, history[-1].at, "future", "latest")
        if after == 0:
            raise _extrapolation(at, history[0].at, "past", "earliest")
        one, other = history[after - 1], history[after]
        return interpolate(one.rigid, other.rigid, (at - one.at) / (other.at - one.at))


def _time(sample: _Sample) -> Ns:
    return sample.at


def _extrapolation(requested: Ns, known: Ns, direction: str, which: str) -> ExtrapolationException:
    return ExtrapolationException(
        f"Lookup would require extrapolation into the {direction}.  Requested time "
        f"{to_seconds(requested):.6f} but the {which} data is at time {to_seconds(known):.6f}"
    )


def _problem(child: str, parent: str) -> str:
    if not child or not parent:
        return "a frame without a name"
    if child == parent:
        return "a frame cannot be its own parent"
    if child.startswith("/") or parent.startswith("/"):
        return "tf2 frame_ids cannot start with a '/'"
    return ""
