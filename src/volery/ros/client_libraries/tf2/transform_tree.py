"""tf2's exceptions, under its own names.

Rigid transforms: a rotation (w, x, y, z) and a translation in metres, child to parent.

What is known of frames: a tree of transforms over time, asked as tf2 is.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Iterator
from math import acos, sin, sqrt
from typing import Any, NamedTuple

from volery.base.frames import Quaternion, Vector, multiply
from volery.base.time import Ns, S, to_seconds


class TransformException(Exception):  # noqa: N818 - tf2's name
    """What tf2 raises."""


class LookupException(TransformException):
    """A frame that nobody has told of."""


class ConnectivityException(TransformException):
    """Two frames that nothing connects."""


class ExtrapolationException(TransformException):
    """A time that is before or after all that is known."""


class InvalidArgumentException(TransformException):
    """A frame's name, or a rotation, that is none."""


class TimeoutException(TransformException):
    """It took too long."""


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


class RigidTransform(NamedTuple):
    """A point p of the child is ``translation`` + ``rotation`` p in the parent."""

    rotation: Quaternion
    translation: Vector

    def point(self, p: Vector) -> Vector:
        """A point of the child in the parent's axes."""
        x, y, z = rotated(self.rotation, p)
        return x + self.translation[0], y + self.translation[1], z + self.translation[2]

    def then(self, outer: RigidTransform) -> RigidTransform:
        """This one, then from its parent to the parent of that."""
        return RigidTransform(multiply(outer.rotation, self.rotation), outer.point(self.translation))

    def inverse(self) -> RigidTransform:
        """From the parent to the child."""
        back = conjugate(self.rotation)
        x, y, z = rotated(back, self.translation)
        return RigidTransform(back, (-x, -y, -z))


IDENTITY = RigidTransform((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def conjugate(q: Quaternion) -> Quaternion:
    """The rotation back."""
    w, x, y, z = q
    return w, -x, -y, -z


def rotated(q: Quaternion, v: Vector) -> Vector:
    """The vector *v*, rotated."""
    _, x, y, z = multiply(multiply(q, (0.0, *v)), conjugate(q))
    return x, y, z


def interpolate(one: RigidTransform, other: RigidTransform, part: float) -> RigidTransform:
    """*part* of the way from one to the other: straight, and along the shortest arc at constant speed."""
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
    """The quaternion with length 1; ``None`` for one that is no rotation."""
    length = sqrt(sum(part * part for part in q))
    if not 0.0 < length < float("inf"):
        return None
    w, x, y, z = (part / length for part in q)
    return w, x, y, z


def from_transform(transform: Any) -> RigidTransform:
    """From a ``geometry_msgs/msg/Transform``."""
    t, q = transform.translation, transform.rotation
    return RigidTransform((q.w, q.x, q.y, q.z), (t.x, t.y, t.z))


def write_transform(transform: Any, rigid: RigidTransform) -> None:
    """Into a ``geometry_msgs/msg/Transform``."""
    transform.translation.x, transform.translation.y, transform.translation.z = rigid.translation
    turned = transform.rotation
    turned.w, turned.x, turned.y, turned.z = rigid.rotation


LATEST: Ns = 0
"""The time that stands for the latest at which all is known."""
_CACHE: Ns = 10 * S


class _Sample(NamedTuple):
    at: Ns
    parent: str
    rigid: RigidTransform


class TransformTree:
    """Frames and their parents.

    What is older than *cache* before a frame's newest is forgotten; a static transform holds at all times.
    """

    def __init__(self, cache: Ns = _CACHE) -> None:
        self._cache = cache
        self._moving: dict[str, list[_Sample]] = {}
        self._static: dict[str, _Sample] = {}
        self._parents: dict[str, None] = {}

    def clear(self) -> None:
        """Forget what moves."""
        self._moving.clear()

    def frames(self) -> list[str]:
        """All that have been told of, sorted."""
        return sorted({*self._parents, *self._moving, *self._static})

    def learn(self, child: str, parent: str, at: Ns, rigid: RigidTransform, *, static: bool = False) -> None:
        """Where *child* lies in *parent* at a time. ``InvalidArgumentException`` for what is no transform."""
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
        """What takes a point of *source* to *target*, and the time that it holds for.

        Raises what tf2 does: ``LookupException``, ``ConnectivityException``, ``ExtrapolationException``.
        """
        known = self.frames()
        for name, role in ((target, "target_frame"), (source, "source_frame")):
            if name not in known:
                raise LookupException(
                    f'"{name}" passed to lookupTransform argument {role} does not exist. '
                    f"There is {', '.join(known) or 'none'}"
                )
        up, down = self._ways(target, source)
        if at == LATEST:
            at = self._latest([*up, *down])
        try:
            there, back = self._along(up, at), self._along(down, at)
        except ExtrapolationException as error:
            raise ExtrapolationException(
                f"{error}, when looking up transform from frame [{source}] to frame [{target}]"
            ) from None
        return at, there.then(back.inverse())

    def _ways(self, target: str, source: str) -> tuple[list[str], list[str]]:
        """The frames below the first common one, from the source and from the target."""
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
            newest = self._newest(frame)
            if newest is None:
                return
            frame = newest.parent

    def _newest(self, frame: str) -> _Sample | None:
        history = self._moving.get(frame)
        return history[-1] if history else self._static.get(frame)

    def _latest(self, way: list[str]) -> Ns:
        """The latest time for which all that moves on the way is known."""
        moving = [self._moving[frame][-1].at for frame in way if self._moving.get(frame)]
        return min(moving, default=LATEST)

    def _along(self, way: list[str], at: Ns) -> RigidTransform:
        found = IDENTITY
        for frame in way:
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
            raise _beyond(at, history[-1].at, "future", "latest")
        if after == 0:
            raise _beyond(at, history[0].at, "past", "earliest")
        one, other = history[after - 1], history[after]
        return interpolate(one.rigid, other.rigid, (at - one.at) / (other.at - one.at))


def _time(sample: _Sample) -> Ns:
    return sample.at


def _beyond(asked: Ns, known: Ns, direction: str, which: str) -> ExtrapolationException:
    return ExtrapolationException(
        f"Lookup would require extrapolation into the {direction}.  Requested time {to_seconds(asked):.6f} "
        f"but the {which} data is at time {to_seconds(known):.6f}"
    )


def _problem(child: str, parent: str) -> str:
    if not child or not parent:
        return "a frame without a name"
    if child == parent:
        return "a frame cannot be its own parent"
    if child.startswith("/") or parent.startswith("/"):
        return "tf2 frame_ids cannot start with a '/'"
    return ""
