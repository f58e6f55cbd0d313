"""``tf2_geometry_msgs``: points, vectors and poses in another frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.base.errors import choices
from volery.base.frames import multiply
from volery.ros.client_libraries.tf2.errors import InvalidArgumentException
from volery.ros.client_libraries.tf2.geometry import Rigid, from_transform, rotated


def _point(point: Any, by: Rigid) -> None:
    point.x, point.y, point.z = by.point((point.x, point.y, point.z))


def _vector(vector: Any, by: Rigid) -> None:
    vector.x, vector.y, vector.z = rotated(by.rotation, (vector.x, vector.y, vector.z))


def _pose(pose: Any, by: Rigid) -> None:
    _point(pose.position, by)
    q = pose.orientation
    q.w, q.x, q.y, q.z = multiply(by.rotation, (q.w, q.x, q.y, q.z))


_KINDS: dict[str, tuple[str, Callable[[Any, Rigid], None]]] = {
    "geometry_msgs/msg/Point": ("", _point),
    "geometry_msgs/msg/PointStamped": ("point", _point),
    "geometry_msgs/msg/Vector3": ("", _vector),
    "geometry_msgs/msg/Vector3Stamped": ("vector", _vector),
    "geometry_msgs/msg/Pose": ("", _pose),
    "geometry_msgs/msg/PoseStamped": ("pose", _pose),
}
"""What can be transformed: the field that holds it, and how."""


def transformed(given: Any, transform: Any) -> Any:
    """A copy of *given* by a ``TransformStamped``, whose header it then has."""
    name = getattr(given, "__msgtype__", type(given).__name__)
    if name not in _KINDS:
        raise InvalidArgumentException(f"{name} cannot be transformed; choose {choices(_KINDS)}")
    field, change = _KINDS[name]
    made = given.copy()
    change(getattr(made, field) if field else made, from_transform(transform.transform))
    if field:
        made.header = transform.header.copy()
    return made


STAMPED = {
    f"do_transform_{what}": transformed
    for what in ("point", "vector3", "pose", "pose_stamped", "point_stamped", "vector3_stamped")
}
"""``tf2_geometry_msgs``."""
