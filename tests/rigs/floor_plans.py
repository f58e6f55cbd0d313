"""Floor plans of walls, and what a planar lidar sees in them: exact, with noise by seed."""

from __future__ import annotations

import itertools
from math import inf

import numpy as np

from volery.autonomy.laser_scan import LaserScan2, scan_from_ranges
from volery.autonomy.planar_pose import Array, Pose2

ANGLES = np.radians(np.arange(-180.0, 180.0))


def box(west: float, south: float, east: float, north: float) -> list[tuple[float, float, float, float]]:
    return [
        (west, south, east, south),
        (east, south, east, north),
        (east, north, west, north),
        (west, north, west, south),
    ]


OFFICE = np.array(
    [
        *box(0.0, 0.0, 20.0, 14.0),
        *box(4.0, 4.0, 9.0, 10.0),
        *box(12.0, 4.0, 16.0, 10.0),
        (0.0, 7.0, 1.0, 7.0),
        (9.0, 2.0, 9.0, 0.0),
        (14.0, 14.0, 14.0, 12.5),
        *box(18.0, 6.0, 18.6, 6.8),
    ]
)
"""A floor of 20 by 14 m around two blocks: four ways to close a loop."""


def ranges(walls: Array, pose: Pose2, angles: Array = ANGLES, most: float = 10.0) -> Array:
    """Return the distances of the nearest walls along each angle [m], infinity beyond *most*."""
    turned = pose.yaw + angles
    along = np.stack((np.cos(turned), np.sin(turned)), axis=1)[:, None, :]
    start, side = walls[None, :, :2], (walls[:, 2:] - walls[:, :2])[None, :, :]
    off = start - np.array((pose.x, pose.y))
    across = along[..., 0] * side[..., 1] - along[..., 1] * side[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        length = (off[..., 0] * side[..., 1] - off[..., 1] * side[..., 0]) / across
        place = (off[..., 0] * along[..., 1] - off[..., 1] * along[..., 0]) / across
    met = (length > 0.0) & (place >= 0.0) & (place <= 1.0)
    nearest = np.where(met, length, inf).min(axis=1)
    return np.where(nearest < most, nearest, inf)


def scan(
    walls: Array, pose: Pose2, seed: int = 0, sigma: float = 0.01, most: float = 10.0, time: int = 0
) -> LaserScan2:
    seen = ranges(walls, pose, most=most) + np.random.default_rng(seed).normal(0.0, sigma, len(ANGLES))
    return scan_from_ranges(time, ANGLES, seen, 0.05, most)


def tour(corners: list[tuple[float, float]], step: float = 0.2) -> list[Pose2]:
    """Return poses along a way that turns at each corner, facing ahead."""
    poses: list[Pose2] = []
    for (x, y), (to_x, to_y) in itertools.pairwise(corners):
        length = float(np.hypot(to_x - x, to_y - y))
        yaw = float(np.arctan2(to_y - y, to_x - x))
        if poses:
            turn = (yaw - poses[-1].yaw + np.pi) % (2.0 * np.pi) - np.pi
            count = max(1, round(abs(turn) / 0.15))
            poses += (
                [Pose2(x, y, poses[-1].yaw + turn / count) for _ in range(1)]
                if count == 1
                else [Pose2(x, y, poses[-1].yaw + turn * k / count) for k in range(1, count + 1)]
            )
        count = max(1, round(length / step))
        poses += [
            Pose2(x + (to_x - x) * k / count, y + (to_y - y) * k / count, yaw) for k in range(1, count + 1)
        ]
    return poses


def odometry(truth: list[Pose2], seed: int, slip: float = 0.03, drift: float = 0.01) -> list[Pose2]:
    """Return what wheels make of a way: noise by distance and by turn."""
    random = np.random.default_rng(seed)
    at, found = truth[0], [truth[0]]
    for one, other in itertools.pairwise(truth):
        motion = one.to(other)
        way = float(np.hypot(motion.x, motion.y))
        at = at.after(
            Pose2(
                motion.x * (1.0 + slip) + random.normal(0.0, 0.02 * way),
                motion.y + random.normal(0.0, 0.02 * way),
                motion.yaw * (1.0 + 0.05) + random.normal(0.0, drift * way + 0.02 * abs(motion.yaw)),
            )
        )
        found.append(at)
    return found
