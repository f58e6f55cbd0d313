"""Exploration of two rooms from a drive through them."""

import numpy as np

from volery.autonomy.avoidance import Motion
from volery.autonomy.explorer import Explorer
from volery.autonomy.laser_scan import scan_from_ranges
from volery.autonomy.planar_pose import Pose2

ROOM = np.array((4.0, 2.5))


def prepare(seed):
    random = np.random.default_rng(seed)
    angles = np.linspace(-np.pi, np.pi, 240, endpoint=False)
    drive = []
    for number in range(40):
        place = np.array((-2.0 + 0.1 * number, 0.5 * np.sin(0.3 * number)))
        away = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        with np.errstate(divide="ignore"):
            ranges = (np.where(away > 0.0, ROOM - place, -place - ROOM) / away).min(axis=1)
        ranges = np.where(abs(angles) < 0.25, ranges + 4.0, ranges) + random.normal(0.0, 0.01, len(angles))
        scan = scan_from_ranges(200_000_000 * number, angles, ranges, 0.05, 9.0)
        drive.append((Pose2(float(place[0]), float(place[1]), 0.0), scan))
    return drive


def run(drive):
    explorer = Explorer(Motion(radius=0.3, speed=0.8, acceleration=1.0, delay=0.3, sight=9.0), resolution=0.1)
    total = 0.0
    for pose, scan in drive:
        command = explorer.update(scan.time, pose, scan, np.array((0.3, 0.0)))
        total += command.yaw_rate
    return total
