"""A tree of coordinate frames whose transforms change over time, with tf2's lookups and exceptions.

A rigid transform is a rotation quaternion (w, x, y, z) and a translation in metres, from child to parent. The
rules were observed in Debian's tf2 0.7.6. Parameters select ROS 2's where they differ.
"""

from __future__ import annotations

from bisect import bisect_left
from math import isfinite, sqrt
from typing import Any, NamedTuple

from volery.base.elementary import acos, sin
from volery.base.errors import choices
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
_UNIT_TOLERANCE = 10e-3
"""Greatest difference of a rotation's squared length from 1."""


class _Sample(NamedTuple):
    at: Ns
    parent: str
    rigid: RigidTransform


class _Frame:
    """The transforms of one frame to its parents: one that holds at all times, or samples in order of time.

    Which of the two a frame has is decided by its first transform.
    """

    def __init__(self, static: bool) -> None:
        self.static = static
        self.samples: list[_Sample] = []

    def add(self, sample: _Sample, cache: Ns, replace: bool) -> str:
        """Add a sample; return why it is ignored, or ``""``."""
        if self.static:
            self.samples = [sample]
            return ""
        if self.samples and sample.at < self.samples[-1].at - cache:
            return "TF_OLD_DATA ignoring data from the past"
        place = bisect_left(self.samples, sample.at, key=_time)
        if place < len(self.samples) and self.samples[place].at == sample.at:
            if not replace:
                return "TF_REPEATED_DATA ignoring data with redundant timestamp"
            self.samples[place] = sample
            return ""
        self.samples.insert(place, sample)
        del self.samples[: bisect_left(self.samples, self.samples[-1].at - cache, key=_time)]
        return ""

    def at(self, when: Ns, texts: _Texts) -> _Sample:
        """Return the parent at a time and the transform to it; raise ``ExtrapolationException``.

        Between two samples with different parents the earlier one holds.
        """
        if not self.samples:
            raise ExtrapolationException("the buffer is empty")
        if self.static or when == LATEST:
            return self.samples[-1]
        after = bisect_left(self.samples, when, key=_time)
        if after < len(self.samples) and self.samples[after].at == when:
            return self.samples[after]
        if len(self.samples) == 1:
            raise ExtrapolationException(texts.single(when, self.samples[0].at))
        if after == len(self.samples):
            raise ExtrapolationException(texts.beyond(when, self.samples[-1].at, "future", "latest"))
        if after == 0:
            raise ExtrapolationException(texts.beyond(when, self.samples[0].at, "past", "earliest"))
        one, other = self.samples[after - 1], self.samples[after]
        if one.parent != other.parent:
            return one
        part = (when - one.at) / (other.at - one.at)
        return one._replace(rigid=interpolate(one.rigid, other.rigid, part))


class _Texts(NamedTuple):
    """Words of an extrapolation in ROS 1 and ROS 2."""

    ros2: bool

    def _time(self, at: Ns) -> str:
        if self.ros2:
            return f"{to_seconds(at):.6f}"
        whole, part = divmod(at, S)
        return f"{whole}.{part:09d}"

    def beyond(self, when: Ns, known: Ns, direction: str, which: str) -> str:
        """Return the text for a time beyond the samples."""
        distance = "" if self.ros2 else f"{self._time(abs(when - known))}s "
        return (
            f"Lookup would require extrapolation {distance}into the {direction}.  Requested time "
            f"{self._time(when)} but the {which} data is at time {self._time(known)}"
        )

    def single(self, when: Ns, known: Ns) -> str:
        """Return the text for another time than that of the only sample."""
        return (
            f"Lookup would require extrapolation at time {self._time(when)}, but only time "
            f"{self._time(known)} is in the buffer"
        )


class TransformTree:
    """Frames and their transforms to their parents, which may change.

    Samples of a frame that are older than its newest one by more than *cache* are removed. A static transform
    is valid at all times.

    Args:
        cache: Longest time for which samples are kept, ns.
        ros2: Whether a second sample of one time replaces the first, as in ROS 2; in ROS 1 the first stays.
    """

    def __init__(self, cache: Ns = _CACHE, *, ros2: bool = False) -> None:
        self._cache = cache
        self.ros2 = ros2
        self._frames: dict[str, _Frame] = {}
        self._parents: dict[str, None] = {}

    def clear(self) -> None:
        """Remove all transforms but the static ones; the frames stay known."""
        for frame in self._frames.values():
            if not frame.static:
                frame.samples.clear()

    def frames(self) -> list[str]:
        """Return the names of all frames, sorted."""
        return sorted({*self._parents, *self._frames})

    def described(self) -> list[tuple[str, str, Ns, Ns, int]]:
        """Return of each frame its name, parent, time of the first and last sample, and number of samples."""
        return [
            (name, one.samples[-1].parent, one.samples[0].at, one.samples[-1].at, len(one.samples))
            for name, one in self._frames.items()
            if one.samples
        ]

    def add(self, child: str, parent: str, at: Ns, rigid: RigidTransform, *, static: bool = False) -> str:
        """Add the transform from *child* to *parent* at a time; return why it is ignored, or ``""``.

        A leading slash of a name is dropped. A rotation is kept as it is if its length is nearly 1.
        """
        child, parent = child.removeprefix("/"), parent.removeprefix("/")
        problem = _problem(child, parent, rigid)
        if problem:
            return problem
        frame = self._frames.get(child) or self._frames.setdefault(child, _Frame(static))
        problem = frame.add(_Sample(at, parent, rigid), self._cache, self.ros2)
        if problem:
            return f"{problem} for frame {child} at time {to_seconds(at):.6f}"
        self._parents[parent] = None
        return ""

    def latest_common_time(self, target: str, source: str) -> Ns:
        """Return the latest time at which both frames and those between them are known; 0 if all is static.

        Raises:
            ConnectivityException: The frames are not connected.
        """
        chains = [self._newest_parents(frame) for frame in (target, source)]
        common = next((frame for frame in chains[1] if frame in chains[0]), None)
        if common is None:
            raise _unconnected(target, source)
        below = [frame for chain in chains for frame in chain[: chain.index(common)]]
        known = [self._frames[frame] for frame in below]
        return min((one.samples[-1].at for one in known if not one.static), default=LATEST)

    def _newest_parents(self, frame: str) -> list[str]:
        found = [frame]
        while self._frames.get(frame) is not None and self._frames[frame].samples:
            frame = self._frames[frame].samples[-1].parent
            if frame in found:
                raise LookupException("The tf tree is invalid because it contains a loop.")
            found.append(frame)
        return found

    def look_up(self, target: str, source: str, at: Ns) -> tuple[Ns, RigidTransform]:
        """Return the transform from *source* to *target* and the time for which it is valid.

        Args:
            target: Frame to transform to.
            source: Frame to transform from.
            at: ROS time in ns, or ``LATEST``.

        Raises:
            InvalidArgumentException: A frame name is empty or begins with a slash.
            LookupException: A frame is unknown.
            ConnectivityException: The frames are not connected at that time.
            ExtrapolationException: The time is before or after all known transforms.
        """
        for name, role in ((target, "target_frame"), (source, "source_frame")):
            self._check(name, role)
        if target == source:
            frame = self._frames.get(target)
            own = LATEST if frame is None or frame.static or not frame.samples else frame.samples[-1].at
            return (own if at == LATEST else at), IDENTITY
        if at == LATEST:
            at = self.latest_common_time(target, source)
        up, up_ends = self._upward(source, at)
        down, down_ends = self._upward(target, at)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            ended = down_ends or up_ends
            if ended is None:
                raise _unconnected(target, source)
            raise ExtrapolationException(
                f"{ended}, when looking up transform from frame [{source}] to frame [{target}]"
            )
        return at, up[common].then(down[common].inverse())

    def _check(self, name: str, role: str) -> None:
        of = f"passed to lookupTransform argument {role}"
        if not name:
            raise InvalidArgumentException(f"Invalid argument {of} in tf2 frame_ids cannot be empty")
        if name.startswith("/"):
            raise InvalidArgumentException(
                f"Invalid argument \"{name}\" {of} in tf2 frame_ids cannot start with a '/' like: "
            )
        if name not in self._parents and name not in self._frames:
            raise LookupException(f'"{name}" {of} does not exist. There is {choices(self.frames())}')

    def _upward(self, frame: str, at: Ns) -> tuple[dict[str, RigidTransform], ExtrapolationException | None]:
        """Return the frames above one at a time with the transforms to them, and what ends them early."""
        found = {frame: IDENTITY}
        texts = _Texts(self.ros2)
        while frame in self._frames:
            try:
                sample = self._frames[frame].at(at, texts)
            except ExtrapolationException as error:
                return found, error
            if sample.parent in found:
                raise LookupException("The tf tree is invalid because it contains a loop.")
            found[sample.parent] = found[frame].then(sample.rigid)
            frame = sample.parent
        return found, None


def _time(sample: _Sample) -> Ns:
    return sample.at


def _unconnected(target: str, source: str) -> ConnectivityException:
    return ConnectivityException(
        f"Could not find a connection between '{target}' and '{source}' because they are not part of the "
        f"same tree. Tf has two or more unconnected trees."
    )


def _problem(child: str, parent: str, rigid: RigidTransform) -> str:
    """Return why tf2 ignores a transform, in the words of its log, or ``""``."""
    if not child:
        return "TF_NO_CHILD_FRAME_ID: Ignoring transform because child_frame_id not set"
    if not parent:
        return f'TF_NO_FRAME_ID: Ignoring transform with child_frame_id "{child}" because frame_id not set'
    if child == parent:
        return f'TF_SELF_TRANSFORM: Ignoring transform with frame_id and child_frame_id "{child}"'
    of = f'Ignoring transform for child_frame_id "{child}" because of'
    if not all(isfinite(part) for part in (*rigid.translation, *rigid.rotation)):
        return f"TF_NAN_INPUT: {of} a nan value in the transform"
    if abs(sum(part * part for part in rigid.rotation) - 1.0) >= _UNIT_TOLERANCE:
        w, x, y, z = rigid.rotation
        return (
            f"TF_DENORMALIZED_QUATERNION: {of} an invalid quaternion in the transform "
            f"({x:f} {y:f} {z:f} {w:f})"
        )
    return ""
