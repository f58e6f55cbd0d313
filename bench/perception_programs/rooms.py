"""Two rooms with a door between them, mapped by a scanner of 270 degrees with odometry that slips."""

import numpy as np

from volery.autonomy.laser_scan import scan_from_ranges
from volery.autonomy.planar_pose import Pose2
from volery.autonomy.slam import Slam

WALLS = np.array([
    (-6, -3, 6, -3), (6, -3, 6, 3), (6, 3, -6, 3), (-6, 3, -6, -3), (0, -3, 0, -0.8), (0, 0.8, 0, 3),
    (2, 1, 3.5, 1), (3.5, 1, 3.5, 2), (-4, -2, -3, -1.2), (-3, -1.2, -2.5, -2),
], dtype=float)  # fmt: skip


def distances(x, y, angles):
    ahead = np.stack((np.cos(angles), np.sin(angles)), axis=1)[:, None, :]
    start, along = WALLS[None, :, :2] - (x, y), WALLS[None, :, 2:] - WALLS[None, :, :2]
    crossed = ahead[..., 0] * along[..., 1] - ahead[..., 1] * along[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (start[..., 0] * along[..., 1] - start[..., 1] * along[..., 0]) / crossed
        at = (start[..., 0] * ahead[..., 1] - start[..., 1] * ahead[..., 0]) / crossed
    return np.where((far > 0.0) & (at >= 0.0) & (at <= 1.0), far, np.inf).min(axis=1)


def prepare(seed):
    random = np.random.default_rng(seed)
    angles = np.radians(np.linspace(-135.0, 135.0, 271))
    log = []
    for number in range(70):
        x, yaw = -4.0 + 0.11 * number, 0.3 * np.sin(0.2 * number)
        y = 0.4 * np.sin(0.15 * number)
        ranges = distances(x, y, angles + yaw) + random.normal(0.0, 0.012, len(angles))
        scan = scan_from_ranges(100_000_000 * number, angles, ranges, 0.05, 10.0)
        log.append((Pose2(1.02 * x, y + 0.01 * number, yaw + 0.002 * number), scan))
    return log


def run(log):
    slam = Slam()
    for odometry, scan in log:
        slam.add(odometry, scan)
    slam.finish(1)
    return slam.poses[-1].x
