"""Recordings of planar scans with odometry: logs of CARMEN, tables of ranges, rosbag 1, rosbag 2 and MCAP."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.laser_scan import LaserScan2, scan_from_ranges, scan_of
from volery.autonomy.planar_pose import Array, Pose2
from volery.base.errors import UsageError, choices
from volery.base.frames import quaternion_to_euler
from volery.base.time import Ns, S

LEAST, MOST = 0.05, 40.0
"""Ranges [m] of logs that state no limits: nearer is the robot itself, farther is a beam that met nothing."""

_SCAN, _ODOMETRY, _TRANSFORMS = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"


class Step(NamedTuple):
    """A scan, and the pose of the vehicle by its odometry when it was taken."""

    odometry: Pose2
    scan: LaserScan2


class LaserLog(NamedTuple):
    """A recording.

    Args:
        steps: Its scans in order of time; they are read as they are asked for.
        odometry: Where the odometry comes from; empty: there is none, and it stays where it is.
        damage: What could not be read; it grows while the steps are read.
    """

    steps: Iterator[Step]
    odometry: str
    damage: list[str]


def read_laser_log(path: Path, scan: str = "", odometry: str = "") -> LaserLog:
    """Return the scans of a recording.

    Args:
        path: A log of CARMEN (lines ``FLASER`` or ``ROBOTLASER1``), a table with commas (time [s], x, y [m],
            yaw [rad] of the odometry, then ranges [m] over 180 degrees from right to left), or a bag.
        scan: Topic of the scans in a bag; empty: the only one.
        odometry: Topic of ``nav_msgs/Odometry`` in a bag; empty: the only one, or the transform from
            ``odom``.

    Raises:
        UsageError: There is no such file, or it has no scans; the text says what it has.
    """
    if not path.exists():
        raise UsageError(f"{path}: there is no such file or folder")
    if path.is_dir() or path.suffix in {".bag", ".mcap", ".db3"}:
        return _bag(path, scan, odometry)
    damage: list[str] = []
    with path.open("rb") as file:
        head = file.read(4096)
    if b"\0" in head:
        raise UsageError(f"{path}: neither text nor a bag; give a log of CARMEN, a table or a bag")
    words = {line.split(b" ", 1)[0] for line in head.splitlines()}
    carmen = path.suffix in {".log", ".clf"} or bool(words & {b"FLASER", b"ROBOTLASER1", b"PARAM", b"ODOM"})
    return LaserLog(_text(path, carmen, damage), "the recorded odometry", damage)


def _text(path: Path, carmen: bool, damage: list[str]) -> Iterator[Step]:
    found = wrong = 0
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            if not line.strip() or line.startswith("#"):
                continue
            try:
                step = _carmen(line.split()) if carmen else _row(line.split(","))
            except (ValueError, IndexError):
                wrong += 1
                continue
            if step is not None:
                found += 1
                yield step
    if wrong:
        damage.append(f"{wrong} lines that are no whole scan are left out")
    if not found:
        wanted = "lines FLASER or ROBOTLASER1" if carmen else "rows of time, x, y, yaw and at least 10 ranges"
        raise UsageError(f"{path}: no scan in it; there must be {wanted}")


def _row(words: list[str]) -> Step | None:
    values = np.array(words, dtype=np.float64)
    if len(values) < 14 or not np.isfinite(values[:4]).all():
        raise ValueError("too short")
    return _step(float(values[0]), Pose2(*map(float, values[1:4])), values[4:])


def _carmen(words: list[str]) -> Step | None:
    if words[0] == "FLASER":
        count = int(words[1])
        ranges = np.array(words[2 : 2 + count], dtype=np.float64)
        rest = words[2 + count :]
        return _step(float(rest[6]), Pose2(*map(float, rest[3:6])), ranges)
    if words[0] == "ROBOTLASER1":
        first, field, step, most = map(float, words[2:6])
        count = int(words[8])
        ranges = np.array(words[9 : 9 + count], dtype=np.float64)
        rest = words[9 + count :]
        rest = rest[1 + int(rest[0]) :]
        laser, robot = Pose2(*map(float, rest[:3])), Pose2(*map(float, rest[3:6]))
        angles: Array = first + (step or field / max(count - 1, 1)) * np.arange(count, dtype=np.float64)
        time = round(float(rest[11]) * S)
        return Step(
            robot, _heard(scan_from_ranges(time, angles, ranges, LEAST, min(most, MOST), robot.to(laser)))
        )
    return None


def _step(time: float, odometry: Pose2, ranges: Array) -> Step:
    spaces = len(ranges) - len(ranges) % 2  # 180 beams end a step before the left, 181 end on it
    angles = np.radians(-90.0 + 180.0 / spaces * np.arange(len(ranges), dtype=np.float64))
    return Step(odometry, _heard(scan_from_ranges(round(time * S), angles, ranges, LEAST, MOST)))


def _heard(scan: LaserScan2) -> LaserScan2:
    """Return a scan without its open beams: in these logs a beam of the largest range may have met glass."""
    return scan._replace(open_ends=np.zeros((0, 2)))


# -- bags


def _bag(path: Path, scan: str, odometry: str) -> LaserLog:
    from volery.ros.messages.bags import open_bag  # noqa: PLC0415  # rosbags is an extra, and slow to import

    bag = open_bag(path)
    topics = {topic.name: topic.type for topic in bag.topics}
    scans = _only(path, topics, _SCAN, scan)
    if not scans:
        listed = choices(topics) if topics else "none"
        raise UsageError(f"{path}: no topic of {_SCAN}; its topics: {listed}")
    moved = _only(path, topics, _ODOMETRY, odometry)
    frames = [name for name, kind in topics.items() if kind == _TRANSFORMS]
    transforms = list(_transforms(bag.messages(frames))) if frames else []
    if moved:
        messages: Iterable[Any] = bag.messages([moved])
        poses = [
            (_ns(one.message.header.stamp) or one.at, _planar(one.message.pose.pose)) for one in messages
        ]
        words = moved
    else:
        poses = [
            (at, pose) for at, parent, _, pose in transforms if parent.strip("/").rpartition("/")[2] == "odom"
        ]
        words = "the transform from odom" if poses else ""
    mounted = {child.strip("/"): pose for _, parent, child, pose in transforms if "base" in parent}
    return LaserLog(_steps(bag.messages([scans]), poses, mounted, bag.damage), words, bag.damage)


def _only(path: Path, topics: dict[str, str], kind: str, wanted: str) -> str:
    of_kind = sorted(name for name, one in topics.items() if one == kind)
    if wanted:
        name = wanted if wanted.startswith("/") else f"/{wanted}"
        if name not in of_kind:
            there = choices(of_kind) if of_kind else "none"
            raise UsageError(f"{path}: no topic {name} of {kind}; there is {there}")
        return name
    if len(of_kind) > 1:
        option = "--scan" if kind == _SCAN else "--odometry"
        raise UsageError(f"{path}: several topics of {kind}; choose one by {option}: {', '.join(of_kind)}")
    return of_kind[0] if of_kind else ""


def _steps(
    messages: Iterable[Any], poses: list[tuple[Ns, Pose2]], mounted: dict[str, Pose2], damage: list[str]
) -> Iterator[Step]:
    times = np.array([at for at, _ in poses], dtype=np.int64)
    wrong = 0
    for one in messages:
        try:
            scan = scan_of(one.message, mounted.get(one.message.header.frame_id.strip("/"), Pose2()))
        except UsageError:
            wrong += 1
            continue
        time = scan.time or one.at
        yield Step(_at(times, poses, time), scan._replace(time=time))
    if wrong:
        damage.append(f"{wrong} scans without usable angles or limits are left out")


def _at(times: np.ndarray, poses: list[tuple[Ns, Pose2]], time: Ns) -> Pose2:
    """Return the odometry at a time, between its messages in proportion."""
    if not poses:
        return Pose2()
    after = int(np.searchsorted(times, time))
    if after == 0 or after == len(poses):
        return poses[min(after, len(poses) - 1)][1]
    (start, one), (end, other) = poses[after - 1], poses[after]
    part = (time - start) / (end - start)
    motion = one.to(other)
    return one.after(Pose2(part * motion.x, part * motion.y, part * motion.yaw))


def _ns(stamp: Any) -> Ns:
    seconds, rest = (stamp.sec, stamp.nanosec) if hasattr(stamp, "sec") else (stamp.secs, stamp.nsecs)
    return int(seconds) * S + int(rest)


def _planar(pose: Any, position: str = "position", orientation: str = "orientation") -> Pose2:
    place, turn = getattr(pose, position), getattr(pose, orientation)
    _, _, yaw = quaternion_to_euler((turn.w, turn.x, turn.y, turn.z))
    return Pose2(float(place.x), float(place.y), yaw)


def _transforms(messages: Iterable[Any]) -> Iterator[tuple[Ns, str, str, Pose2]]:
    """Yield time, parent, child and planar part of transforms."""
    for one in messages:
        for moved in one.message.transforms:
            planar = _planar(moved.transform, "translation", "rotation")
            yield _ns(moved.header.stamp) or one.at, moved.header.frame_id, moved.child_frame_id, planar
