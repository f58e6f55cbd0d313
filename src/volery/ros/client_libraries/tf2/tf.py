"""``tf``, the older transform library of ROS 1, built on tf2, and ``tf.transformations``.

Of ``tf.transformations`` there are Euler angles with all axes, quaternions (x, y, z, w), and 4 x 4 matrices
of rotations and translations.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import pi, sqrt
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from volery.base.elementary import acos, atan2, cos, sin
from volery.base.errors import UsageError
from volery.base.frames import Quaternion, euler_to_quaternion, multiply, quaternion_to_euler
from volery.ros.client_libraries.tf2.tf2_ros import rotation_matrix as rotation_of
from volery.ros.client_libraries.tf2.transform_tree import TransformException, conjugate, normalised
from volery.ros.messages import new


def _without_slash(frame: str) -> str:
    """Return a frame name without a leading slash, which tf allows and tf2 does not."""
    return frame.lstrip("/")


class Transformer:
    """``tf.Transformer``: a buffer that the file fills."""

    tf2_ros: ClassVar[ModuleType]

    def __init__(self, interpolate: bool = True, cache_time: Any = None, *options: Any) -> None:
        self._buffer = self.tf2_ros.Buffer(cache_time)

    def setTransform(self, transform: Any, authority: str = "default_authority") -> None:  # noqa: N802
        """Add a ``TransformStamped``."""
        self._buffer.set_transform(transform, authority)

    def clear(self) -> None:
        """Remove all transforms."""
        self._buffer.clear()

    def lookupTransform(  # noqa: N802 - tf's name
        self, target_frame: str, source_frame: str, time: Any
    ) -> tuple[list[float], list[float]]:
        """Return translation (x, y, z) and rotation (x, y, z, w)."""
        return _parts(
            self._buffer.lookup_transform(_without_slash(target_frame), _without_slash(source_frame), time)
        )

    def lookupTransformFull(  # noqa: N802 - tf's name
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> tuple[list[float], list[float]]:
        """Return translation and rotation between two frames at two times, via a fixed frame."""
        target, source, fixed = map(_without_slash, (target_frame, source_frame, fixed_frame))
        return _parts(self._buffer.lookup_transform_full(target, target_time, source, source_time, fixed))

    def canTransform(self, target_frame: str, source_frame: str, time: Any) -> Any:  # noqa: N802 - tf's name
        """Return whether the transform is available."""
        return self._buffer.can_transform(_without_slash(target_frame), _without_slash(source_frame), time)

    def waitForTransform(  # noqa: N802 - tf's name
        self,
        target_frame: str,
        source_frame: str,
        time: Any,
        timeout: Any,
        polling_sleep_duration: Any = None,
    ) -> None:
        """Block until the transform is available; raise ``tf.Exception`` after a time-out."""
        can, why = self._buffer.can_transform(
            _without_slash(target_frame), _without_slash(source_frame), time, timeout, return_debug_tuple=True
        )
        if not can:
            raise TransformException(why)

    def waitForTransformFull(  # noqa: N802, PLR0917 - tf's
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any,
        polling_sleep_duration: Any = None,
    ) -> None:
        """Block until the transform between two times is available; raise ``tf.Exception`` else."""
        target, source, fixed = map(_without_slash, (target_frame, source_frame, fixed_frame))
        can, why = self._buffer.can_transform_full(
            target, target_time, source, source_time, fixed, timeout, True
        )
        if not can:
            raise TransformException(why)

    def canTransformFull(  # noqa: N802 - tf's name
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> Any:
        """Return whether the transform between two times is available."""
        target, source, fixed = map(_without_slash, (target_frame, source_frame, fixed_frame))
        return self._buffer.can_transform_full(target, target_time, source, source_time, fixed)

    def setUsingDedicatedThread(self, value: bool) -> None:  # noqa: N802 - tf's name
        """Do nothing: waits never keep others from running."""

    def frameExists(self, frame_id: str) -> bool:  # noqa: N802 - tf's name
        """Return whether a frame is known."""
        return _without_slash(frame_id) in self._buffer.all_frames_as_list()

    def getFrameStrings(self) -> list[str]:  # noqa: N802 - tf's name
        """Return the names of all frames."""
        return list(self._buffer.all_frames_as_list())

    def allFramesAsString(self) -> str:  # noqa: N802 - tf's name
        """Return a line of each frame with its parent."""
        return str(self._buffer.all_frames_as_string())

    def getLatestCommonTime(self, source_frame: str, dest_frame: str) -> Any:  # noqa: N802 - tf's name
        """Return the latest time at which the transform between two frames is known."""
        return self._buffer.get_latest_common_time(_without_slash(source_frame), _without_slash(dest_frame))

    def getTFPrefix(self) -> str:  # noqa: N802 - tf's name
        """Return ``""``: prefixes are those of tf 1.6 and older."""
        return ""


class TransformerROS(Transformer):
    """``tf.TransformerROS``: transforms messages as well."""

    def asMatrix(self, target_frame: str, hdr: Any) -> Any:  # noqa: N802 - tf's name
        """Return the 4 x 4 matrix from the frame and time of a header to another frame."""
        return self.fromTranslationRotation(*self.lookupTransform(target_frame, hdr.frame_id, hdr.stamp))

    def fromTranslationRotation(self, translation: Any, rotation: Any) -> Any:  # noqa: N802 - tf's name
        """Return the 4 x 4 matrix of a translation and a rotation (x, y, z, w)."""
        return translation_matrix(translation) @ quaternion_matrix(rotation)

    def transformPose(self, target_frame: str, ps: Any) -> Any:  # noqa: N802 - tf's name
        """Return a ``PoseStamped`` in another frame."""
        return self._transformed(target_frame, ps)

    def transformPoint(self, target_frame: str, ps: Any) -> Any:  # noqa: N802 - tf's name
        """Return a ``PointStamped`` in another frame."""
        return self._transformed(target_frame, ps)

    def transformVector3(self, target_frame: str, v3s: Any) -> Any:  # noqa: N802 - tf's name
        """Return a ``Vector3Stamped`` in another frame."""
        return self._transformed(target_frame, v3s)

    def transformQuaternion(self, target_frame: str, ps: Any) -> Any:  # noqa: N802 - tf's name
        """Return a ``QuaternionStamped`` in another frame."""
        _, turned = self.lookupTransform(target_frame, ps.header.frame_id, ps.header.stamp)
        made, q = ps.copy(), ps.quaternion
        made.header.frame_id = target_frame
        part = made.quaternion
        part.x, part.y, part.z, part.w = quaternion_multiply(turned, (q.x, q.y, q.z, q.w)).tolist()
        return made

    def _transformed(self, target_frame: str, given: Any) -> Any:
        wanted = given.copy()
        wanted.header.frame_id = _without_slash(given.header.frame_id)
        made = self._buffer.transform(wanted, _without_slash(target_frame))
        made.header.stamp = given.header.stamp
        made.header.frame_id = target_frame
        return made


class TransformListener(TransformerROS):
    """``tf.TransformListener``: a buffer with its listener."""

    def __init__(self, *options: Any, **more: Any) -> None:
        super().__init__()
        self._listener = self.tf2_ros.TransformListener(self._buffer)


def _parts(found: Any) -> tuple[list[float], list[float]]:
    t, q = found.transform.translation, found.transform.rotation
    return [t.x, t.y, t.z], [q.x, q.y, q.z, q.w]


class TransformBroadcaster:
    """``tf.TransformBroadcaster``."""

    tf2_ros: ClassVar[ModuleType]

    def __init__(self, queue_size: int = 100) -> None:
        self._broadcaster = self.tf2_ros.TransformBroadcaster()

    def sendTransform(  # noqa: N802 - tf's name
        self, translation: Sequence[float], rotation: Sequence[float], time: Any, child: str, parent: str
    ) -> None:
        """Publish the transform from *child* to *parent*."""
        made = new("geometry_msgs/msg/TransformStamped", child_frame_id=_without_slash(child))
        made.header.frame_id, made.header.stamp = _without_slash(parent), time
        moved, turned = made.transform.translation, made.transform.rotation
        moved.x, moved.y, moved.z = map(float, translation)
        turned.x, turned.y, turned.z, turned.w = map(float, rotation)
        self._broadcaster.sendTransform(made)

    def sendTransformMessage(self, transform: Any) -> None:  # noqa: N802 - tf's name
        """Publish a ``TransformStamped``."""
        self._broadcaster.sendTransform(transform)


AXES = "sxyz"


def _wxyz(q: Sequence[float]) -> Quaternion:
    x, y, z, w = (float(part) for part in q)
    return w, x, y, z


def _xyzw(q: Quaternion) -> Any:
    w, x, y, z = q
    return np.array([x, y, z, w])


def _axes(given: Any) -> tuple[bool, tuple[int, int, int]]:
    """Return whether *given*, as ``"sxyz"``, turns with the body, and the numbers of its axes in order."""
    text = str(given)
    if not re.fullmatch("[sr](?!(.)\\1)[xyz](?!(.)\\2)[xyz][xyz]", text):
        raise UsageError(
            f"tf.transformations: axes {given!r}; give s (static) or r (rotating) and three of x, y and z, "
            f"as {AXES!r}"
        )
    first, second, third = ("xyz".index(one) for one in text[1:])
    return text[0] == "r", (first, second, third)


def _about(axis: int, angle: float) -> Any:
    """Return the quaternion (x, y, z, w) of a rotation about an axis."""
    made = np.zeros(4)
    made[axis], made[3] = sin(angle / 2.0), cos(angle / 2.0)
    return made


def euler_from_quaternion(quaternion: Sequence[float], axes: str = AXES) -> tuple[float, float, float]:
    """Return three angles in radians: roll, pitch and yaw."""
    if axes != AXES:
        return euler_from_matrix(quaternion_matrix(quaternion), axes)
    given = normalised(_wxyz(quaternion))
    return (0.0, 0.0, 0.0) if given is None else quaternion_to_euler(given)


def quaternion_from_euler(ai: float, aj: float, ak: float, axes: str = AXES) -> Any:
    """Return the quaternion of three angles in radians: roll, pitch and yaw."""
    if axes == AXES:
        return _xyzw(euler_to_quaternion(ai, aj, ak))
    rotating, order = _axes(axes)
    one, two, three = (_about(axis, angle) for axis, angle in zip(order, (ai, aj, ak), strict=True))
    if rotating:
        one, three = three, one
    return quaternion_multiply(three, quaternion_multiply(two, one))


def euler_matrix(ai: float, aj: float, ak: float, axes: str = AXES) -> Any:
    """Return the 4 x 4 matrix of three angles in radians."""
    return quaternion_matrix(quaternion_from_euler(ai, aj, ak, axes))


def euler_from_matrix(matrix: Any, axes: str = AXES) -> tuple[float, float, float]:
    """Return three angles in radians of the rotation in a matrix."""
    rotating, (i, j, k) = _axes(axes)
    m = np.asarray(matrix, float)
    if rotating:  # angles about rotating axes are those about static ones in reverse
        i, k = k, i
    same = i == k
    last = 3 - i - j if same else k
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    if same:
        side = sqrt(m[i, j] * m[i, j] + m[i, last] * m[i, last])
        second = atan2(side, m[i, i])
        first, third = (m[i, j], m[i, last]), (m[j, i], -m[last, i])
        alone = (-m[j, last], m[j, j])
    else:
        side = sqrt(m[i, i] * m[i, i] + m[j, i] * m[j, i])
        second = atan2(-m[k, i], side)
        first, third = (m[k, j], m[k, k]), (m[j, i], m[i, i])
        alone = (-m[j, k], m[j, j])
    if side <= _SINGULAR:
        first, third = alone, (0.0, 1.0)
    found = (sign * atan2(*first), sign * second, sign * atan2(*third))
    return found[::-1] if rotating else found


_SINGULAR = 4.0 * float(np.finfo(float).eps)


def quaternion_multiply(quaternion1: Sequence[float], quaternion0: Sequence[float]) -> Any:
    """Return the rotation by *quaternion0* followed by *quaternion1*."""
    return _xyzw(multiply(_wxyz(quaternion1), _wxyz(quaternion0)))


def quaternion_conjugate(quaternion: Sequence[float]) -> Any:
    """Return the conjugate."""
    return _xyzw(conjugate(_wxyz(quaternion)))


def quaternion_inverse(quaternion: Sequence[float]) -> Any:
    """Return the inverse rotation."""
    given = _wxyz(quaternion)
    return _xyzw(conjugate(given)) / sum(part * part for part in given)


def quaternion_about_axis(angle: float, axis: Sequence[float]) -> Any:
    """Return the quaternion of a rotation by an angle in radians about an axis."""
    along = unit_vector(axis)
    return np.array([*(along * sin(angle / 2.0)), cos(angle / 2.0)])


def quaternion_matrix(quaternion: Sequence[float]) -> Any:
    """Return the 4 x 4 matrix of a quaternion."""
    made = np.eye(4)
    given = normalised(_wxyz(quaternion))
    if given is not None:
        made[:3, :3] = rotation_of(given)
    return made


def quaternion_from_matrix(matrix: Any) -> Any:
    """Return the quaternion of the rotation in a 4 x 4 matrix."""
    m = np.asarray(matrix, float)[:3, :3]
    trace = float(np.trace(m))
    if trace > 0.0:
        w = sqrt(1.0 + trace) / 2.0
        x, y, z = ((m[b, a] - m[a, b]) / (4.0 * w) for a, b in ((1, 2), (2, 0), (0, 1)))
        return np.array([x, y, z, w])
    i = int(np.argmax(np.diag(m)))
    j, k = (i + 1) % 3, (i + 2) % 3
    made = np.zeros(4)
    made[i] = sqrt(max(0.0, 1.0 + m[i, i] - m[j, j] - m[k, k])) / 2.0
    made[j], made[k] = ((m[i, other] + m[other, i]) / (4.0 * made[i]) for other in (j, k))
    made[3] = (m[k, j] - m[j, k]) / (4.0 * made[i])
    return made


def quaternion_slerp(
    quat0: Sequence[float], quat1: Sequence[float], fraction: float, spin: int = 0, shortestpath: bool = True
) -> Any:
    """Return the quaternion at a fraction (0..1) of the way between two."""
    one, other = unit_vector(quat0), unit_vector(quat1)
    dot = float(np.dot(one, other))
    if fraction in (0.0, 1.0) or abs(abs(dot) - 1.0) < _SINGULAR:
        return other if fraction == 1.0 else one
    if shortestpath and dot < 0.0:
        dot, other = -dot, -other
    angle = acos(max(-1.0, min(1.0, dot))) + spin * pi
    if abs(angle) < _SINGULAR:
        return one
    return (sin((1.0 - fraction) * angle) * one + sin(fraction * angle) * other) / sin(angle)


def identity_matrix() -> Any:
    """Return the 4 x 4 identity matrix."""
    return np.eye(4)


def translation_matrix(direction: Sequence[float]) -> Any:
    """Return the 4 x 4 matrix of a translation."""
    made = np.eye(4)
    made[:3, 3] = np.asarray(direction, float)[:3]
    return made


def translation_from_matrix(matrix: Any) -> Any:
    """Return the translation in a 4 x 4 matrix."""
    return np.array(matrix, float)[:3, 3].copy()


def rotation_matrix(angle: float, direction: Sequence[float], point: Sequence[float] | None = None) -> Any:
    """Return the 4 x 4 matrix of a rotation by an angle in radians about an axis through a point."""
    made = quaternion_matrix(quaternion_about_axis(angle, direction[:3]))
    if point is not None:
        through = np.asarray(point, float)[:3]
        made[:3, 3] = through - made[:3, :3] @ through
    return made


def scale_matrix(factor: float) -> Any:
    """Return the 4 x 4 matrix that scales by a factor."""
    return np.diag((factor, factor, factor, 1.0))


def concatenate_matrices(*matrices: Any) -> Any:
    """Return the product of matrices."""
    made = np.eye(4)
    for matrix in matrices:
        made = made @ matrix
    return made


def inverse_matrix(matrix: Any) -> Any:
    """Return the inverse of a matrix."""
    return np.linalg.inv(matrix)


def is_same_transform(matrix0: Any, matrix1: Any) -> bool:
    """Return whether two 4 x 4 matrices are the same transform."""
    one, other = (np.array(matrix, float) / matrix[3][3] for matrix in (matrix0, matrix1))
    return bool(np.allclose(one, other))


def vector_norm(data: Any, axis: int | None = None) -> Any:
    """Return the length of a vector, or of the vectors along an axis."""
    return np.linalg.norm(np.asarray(data, float), axis=axis)


def unit_vector(data: Any, axis: int | None = None) -> Any:
    """Return vectors of the same direction with length 1."""
    given = np.array(data, float)
    if axis is None:
        return given / np.sqrt(np.sum(given * given))
    return given / np.expand_dims(np.linalg.norm(given, axis=axis), axis)


TRANSFORMATIONS = {
    one.__name__: one
    for one in (
        *(euler_from_quaternion, quaternion_from_euler, euler_matrix, euler_from_matrix, quaternion_multiply),
        *(quaternion_conjugate, quaternion_inverse, quaternion_about_axis, quaternion_matrix),
        *(quaternion_from_matrix, quaternion_slerp, identity_matrix, translation_matrix),
        *(translation_from_matrix, rotation_matrix, scale_matrix, concatenate_matrices, inverse_matrix),
        *(is_same_transform, vector_norm, unit_vector),
    )
}
"""Content of ``tf.transformations``, which is called ``tf_transformations`` in ROS 2."""
