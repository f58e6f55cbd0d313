"""``tf.transformations`` as far as nodes use it: angles and quaternions (x, y, z, w), axes ``sxyz``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from volery.base.errors import UsageError
from volery.base.frames import Quaternion, euler_to_quaternion, multiply, quaternion_to_euler
from volery.ros.client_libraries.tf2.geometry import conjugate, normal

AXES = "sxyz"


def _check(axes: str) -> None:
    if axes != AXES:
        raise UsageError(
            f"tf.transformations: axes {axes!r} are not there on the embedded graph; use {AXES!r}"
        )


def _ours(q: Sequence[float]) -> Quaternion:
    x, y, z, w = (float(part) for part in q)
    return w, x, y, z


def _theirs(q: Quaternion) -> Any:
    w, x, y, z = q
    return np.array([x, y, z, w])


def euler_from_quaternion(quaternion: Sequence[float], axes: str = AXES) -> tuple[float, float, float]:
    """Roll, pitch and yaw in radians."""
    _check(axes)
    given = normal(_ours(quaternion))
    return (0.0, 0.0, 0.0) if given is None else quaternion_to_euler(given)


def quaternion_from_euler(ai: float, aj: float, ak: float, axes: str = AXES) -> Any:
    """Of roll, pitch and yaw in radians."""
    _check(axes)
    return _theirs(euler_to_quaternion(ai, aj, ak))


def quaternion_multiply(quaternion1: Sequence[float], quaternion0: Sequence[float]) -> Any:
    """Rotate by the second, then by the first."""
    return _theirs(multiply(_ours(quaternion1), _ours(quaternion0)))


def quaternion_inverse(quaternion: Sequence[float]) -> Any:
    """The rotation back."""
    given = _ours(quaternion)
    return _theirs(conjugate(given)) / sum(part * part for part in given)


TRANSFORMATIONS = {
    one.__name__: one
    for one in (euler_from_quaternion, quaternion_from_euler, quaternion_multiply, quaternion_inverse)
}
"""``tf.transformations``, which ROS 2 users have as ``tf_transformations``."""
