"""A planar scan from a depth picture: of each column the pixels whose rays are nearest to level."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.planar_pose import Array
from volery.base.errors import UsageError
from volery.ros.client_libraries.tf2.transform_tree import RigidTransform, rotated
from volery.ros.messages.message import nanoseconds

AHEAD = RigidTransform((0.5, -0.5, 0.5, -0.5), (0.0, 0.0, 0.0))
"""A camera in the vehicle's centre that looks ahead: its axes are right, down and ahead (REP 103)."""

_ROWS = 3
"""Pixels of a column of which the middle depth counts."""
_LEVEL = 0.05
"""Largest slope of a ray that counts as level: 5 cm in a metre."""
_LEAST = 0.05  # [m]
DEPTHS = {"32FC1": ("f4", 1.0), "16UC1": ("u2", 0.001)}
"""Type of a value and its unit [m], by encoding (REP 118)."""


class DepthView(NamedTuple):
    """The level rays of a camera: pixels (rows, columns) and where they go in the vehicle's frame.

    Args:
        rows: Row of each pixel (k, n); columns run from right to left, so that bearings grow.
        columns: Its column.
        rays: What a metre of depth is ahead and to the left in the vehicle's frame (k, n, 2).
        origin: Place of the camera in the vehicle's frame [m].
        size: Height and width of the pictures.
    """

    rows: np.ndarray[Any, Any]
    columns: np.ndarray[Any, Any]
    rays: Array
    origin: Array
    size: tuple[int, int]


def depth_view(info: Any, mounting: RigidTransform = AHEAD) -> DepthView:
    """Return the level rays of a ``sensor_msgs/CameraInfo`` whose pictures are rectified.

    Args:
        info: The calibration.
        mounting: From the camera's optical frame, whose z axis is where it looks, to the vehicle's frame.

    Raises:
        UsageError: There is no focal length, or the camera sees nothing that is level.
    """
    across, down, x, y = (float(info.k[index]) for index in (0, 4, 2, 5))
    height, width = int(info.height), int(info.width)
    if not (across > 0.0 and down > 0.0 and height > 0 and width > 0 and np.isfinite((x, y)).all()):
        raise UsageError(f"a calibration with focal lengths {across:g} and {down:g} of {width} x {height}")
    rows, columns = np.mgrid[:height, :width]
    ways = np.stack(((columns - x) / across, (rows - y) / down, np.ones(rows.shape)), axis=-1)
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    turned = ways @ np.array([rotated(mounting.rotation, axis) for axis in axes])
    flat = np.sqrt((turned[..., :2] * turned[..., :2]).sum(axis=-1))
    slope = np.abs(turned[..., 2]) / np.maximum(flat, 1e-9)
    chosen = np.argsort(slope, axis=0, kind="stable")[:_ROWS, ::-1]
    column = np.broadcast_to(np.arange(width)[::-1], chosen.shape)
    level = slope[chosen, column].max(axis=0) < _LEVEL
    if not level.any():
        raise UsageError("the camera sees nothing level: a map of a plane needs one that looks ahead")
    chosen, column = chosen[:, level], column[:, level]
    origin = np.array(mounting.translation[:2])
    return DepthView(chosen, column, turned[chosen, column, :2], origin, (height, width))


def depth_scan(message: Any, view: DepthView) -> LaserScan2:
    """Return the scan in a ``sensor_msgs/Image`` of depths: 32FC1 [m] or 16UC1 [mm], by REP 118.

    What has no depth says nothing: how far such a camera would have seen is in no message.

    Raises:
        UsageError: It is no picture of depths, or not of the size of its calibration.
    """
    if message.encoding not in DEPTHS:
        raise UsageError(f"a picture of {message.encoding or 'no encoding'}; depths are 32FC1 or 16UC1")
    kind, unit = DEPTHS[message.encoding]
    height, width = int(message.height), int(message.width)
    value = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    raw = np.asarray(message.data, dtype=np.uint8)
    if (height, width) != view.size or message.step < width * value.itemsize:
        size = f"{view.size[1]} x {view.size[0]}"
        raise UsageError(f"a picture of {width} x {height} with a calibration of {size}")
    if len(raw) < height * message.step:
        raise UsageError(f"a picture of {width} x {height} that is cut off")
    lines = raw[: height * message.step].reshape(height, message.step)[:, : width * value.itemsize]
    depths = np.ascontiguousarray(lines).view(value)[view.rows, view.columns].astype(np.float64) * unit
    with np.errstate(invalid="ignore"):
        depths = np.where((depths > 0.0) & (depths < np.inf), depths, np.inf)
    order = np.argsort(depths, axis=0, kind="stable")[(len(depths) - 1) // 2]
    beams = np.arange(depths.shape[1])
    depth, rays = depths[order, beams], view.rays[order, beams]
    met = np.isfinite(depth) & (depth > _LEAST)
    points = view.origin + depth[met, None] * rays[met]
    return LaserScan2(nanoseconds(message.header.stamp), points, np.zeros((0, 2)))
