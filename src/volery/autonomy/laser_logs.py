"""Recordings of planar scans with odometry: logs of CARMEN, tables of ranges, rosbag 1, rosbag 2 and MCAP."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zlib
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice, pairwise
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from volery.autonomy.depth_scan import AHEAD, DEPTHS, depth_scan, depth_view
from volery.autonomy.laser_scan import LaserScan2, scan_from_ranges, scan_of
from volery.autonomy.planar_pose import Array, Pose2
from volery.autonomy.slam import OF_CAMERA, SlamSettings
from volery.base.errors import UsageError, choices
from volery.base.frames import quaternion_to_euler
from volery.base.time import Ns, S
from volery.ros.client_libraries.tf2.transform_tree import RigidTransform, from_transform, interpolate

if TYPE_CHECKING:
    from volery.autonomy.markers import CameraModel

T = TypeVar("T")

LEAST, MOST = 0.05, 40.0
"""Ranges [m] of logs that state no limits: nearer is the robot itself, farther is a beam that met nothing."""

FARTHEST = 1e7
"""Coordinate [m] beyond which a pose is none of a vehicle on Earth, but damage."""

_IMAGE = "sensor_msgs/msg/Image"
_SCAN, _ODOMETRY, _TRANSFORMS = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
_POSE = "geometry_msgs/msg/PoseStamped"


class LoggedScan(NamedTuple):
    """A scan, and the pose of the vehicle by its odometry when it was taken; None without odometry.

    With pictures of one camera the pose is that of the odometry corrected by them (see ``motion_stereo``).
    """

    odometry: Pose2 | None
    scan: LaserScan2


class LaserLog(NamedTuple):
    """A recording.

    Args:
        steps: Its scans in order of time; they are read as they are asked for.
        odometry: Where the odometry comes from; empty: there is none.
        damage: What could not be read; it grows while the steps are read.
        settings: How such scans become a map.
    """

    steps: Iterator[LoggedScan]
    odometry: str
    damage: list[str]
    settings: SlamSettings = SlamSettings()  # it is immutable


def read_laser_log(path: Path, scan: str = "", odometry: str = "", *, of_camera: bool = False) -> LaserLog:
    """Return the scans of a recording.

    Args:
        path: A log of CARMEN (lines ``FLASER``, ``ROBOTLASER1``, or ``RAWLASER1`` and ``ODOM``), a table with
            commas (time [s], x, y [m], yaw [rad] of the odometry, then ranges [m] over 180 degrees from right
            to left), both also packed with gzip, bzip2 or xz, or a bag.
        scan: Topic of the scans, or of the pictures, in a bag; empty: the only one.
        odometry: Topic of ``nav_msgs/Odometry`` or ``geometry_msgs/PoseStamped`` in a bag; empty: the only
            one of the former, or the transform from ``odom``.
        of_camera: Make the scans of the pictures of a bag: depths (see ``depth_scan``), or the grey or
            coloured ones of one camera that moves (see ``motion_stereo``).

    Raises:
        UsageError: There is no such file, or it has no scans; the text says what it has.
    """
    if not path.exists():
        raise UsageError(f"{path}: there is no such file or folder")
    if path.is_dir() or path.suffix in {".bag", ".mcap", ".db3"}:
        return _bag(path, scan, odometry, of_camera)
    if of_camera:
        raise UsageError(f"{path} is no bag; give one with pictures, or leave out --from camera")
    if scan or odometry:
        raise UsageError(f"{path} is no bag and has no topics; leave out --scan and --odometry")
    damage: list[str] = []
    head = next(iter(_chunks(path, damage)), b"")
    if b"\0" in head:
        raise UsageError(f"{path}: neither text nor a bag; give a log of CARMEN, a table or a bag")
    words = {line.split(b" ", 1)[0] for line in head.splitlines()}
    suffixes = {".log", ".clf"} & set(path.suffixes)
    carmen = bool(suffixes or words & {b"FLASER", b"ROBOTLASER1", b"RAWLASER1", b"PARAM", b"ODOM"})
    damage.clear()  # what is damaged is counted while the scans are read
    return LaserLog(_text(path, carmen, damage), "the recorded odometry", damage)


_OPENERS: Mapping[bytes, Callable[..., Any]] = {b"\x1f\x8b": gzip.open, b"BZ": bz2.open, b"\xfd7": lzma.open}
"""By the first two bytes of a compressed file."""
_CHUNK = 1 << 16


def _chunks(path: Path, damage: list[str]) -> Iterator[bytes]:
    """Yield the content of a file, unpacked; what cannot be unpacked is left out and added to *damage*."""
    with path.open("rb") as file:
        opener = _OPENERS.get(file.read(2), open)
    try:
        with opener(path, "rb") as unpacked:
            while chunk := unpacked.read1(_CHUNK):
                yield chunk
    except (EOFError, OSError, zlib.error, lzma.LZMAError) as error:
        damage.append(f"its end cannot be unpacked: {error}")


def _lines(path: Path, damage: list[str]) -> Iterator[str]:
    rest = b""
    for chunk in _chunks(path, damage):
        *whole, rest = (rest + chunk).split(b"\n")
        for line in whole:
            yield line.decode(errors="replace")
    yield rest.decode(errors="replace")


class _Beams(NamedTuple):
    """The ranges [m] of a scan in a text at angles [rad], and its odometry if that stands in its line."""

    time: Ns
    odometry: Pose2 | None
    angles: Array
    ranges: Array
    most: float = MOST
    mounting: Pose2 = Pose2()


def _text(path: Path, carmen: bool, damage: list[str]) -> Iterator[LoggedScan]:
    text = _read_text(path, carmen, damage)
    if not text:
        wanted = "lines FLASER, ROBOTLASER1 or RAWLASER1" if carmen else _WANTED
        raise UsageError(f"{path}: no scan in it; there must be {wanted}")
    back = sum(after.time < before.time for before, after in pairwise(text))
    if back:
        damage.append(f"{back} scans are older than the one before; they are taken in the order of the file")
    limit = _nothing([one.ranges for one in text])
    for one in text:
        most = min(one.most, MOST, limit)
        scan = scan_from_ranges(one.time, one.angles, one.ranges, LEAST, most, one.mounting)
        yield LoggedScan(one.odometry, scan._replace(open_ends=np.zeros((0, 2))))  # it may have met glass


def _read_text(path: Path, carmen: bool, damage: list[str]) -> list[_Beams]:
    """Return the scans of a text; raw ones only where no line has odometry: it is of the same scans."""
    readers = {"FLASER": _flaser, "ROBOTLASER1": _robotlaser, "RAWLASER1": _rawlaser}
    found: list[_Beams] = []
    raw: list[_Beams] = []
    poses: list[tuple[Ns, Pose2]] = []
    wrong = 0
    for line in _lines(path, damage):
        words = line.split() if carmen else line.split(",")
        kind = words[0] if words else ""
        if not line.strip() or kind.startswith("#"):
            continue
        try:
            if kind == "ODOM":
                poses.append((_seconds(words[7]), _pose(words[1:4])))
            elif not carmen or kind in readers:
                (raw if kind == "RAWLASER1" else found).append(readers.get(kind, _row)(words))
        except (ValueError, IndexError, OverflowError):
            wrong += 1
    if found and not carmen:  # a row that was cut is no scan of fewer beams
        beams = Counter(len(one.ranges) for one in found).most_common(1)[0][0]
        wrong += sum(len(one.ranges) != beams for one in found)
        found = [one for one in found if len(one.ranges) == beams]
    if wrong:
        damage.append(f"{wrong} lines that are no whole scan are left out")
    poses.sort(key=itemgetter(0))
    return found or [one._replace(odometry=between(poses, one.time)) if poses else one for one in raw]


_WANTED = "rows of time, x, y, yaw and at least 10 ranges"


def _nothing(scans: list[Array]) -> float:
    """Return from which range [m] on a beam has met nothing: what is largest again and again is a limit."""
    ranges = np.concatenate(scans)
    ranges = ranges[np.isfinite(ranges)]
    if not len(ranges):
        return MOST
    largest = float(ranges.max())
    limit = 0.99 * largest
    count, below = int((ranges >= 0.999 * largest).sum()), int((ranges >= 0.9 * largest).sum())
    below -= int((ranges >= limit).sum())
    return limit if count >= max(10, 0.001 * len(ranges), 3 * below) else MOST


def _row(words: list[str]) -> _Beams:
    values = np.array(words, dtype=np.float64)
    if len(values) < 14:
        raise ValueError("too short")
    return _half_circle(words[0], _pose(words[1:4]), values[4:])


def _flaser(words: list[str]) -> _Beams:
    count = int(words[1])
    rest = words[2 + count :]
    return _half_circle(rest[6], _pose(rest[3:6]), np.array(words[2 : 2 + count], dtype=np.float64))


_FIELDS = {541: 270.0, 1081: 270.0, 682: 239.77, 683: 239.77}
"""Fields of view [degrees] by the number of beams, where they are not the usual 180."""


def _half_circle(time: str, odometry: Pose2, ranges: Array) -> _Beams:
    count = len(ranges)
    if not count:
        raise ValueError("no range")
    field = _FIELDS.get(count, 180.0)
    spaces = count - count % 2  # 180 beams end a step before the left, 181 end on it
    angles = np.radians(-0.5 * field + field / spaces * np.arange(count, dtype=np.float64))
    return _Beams(_seconds(time), odometry, angles, ranges)


def _rawlaser(words: list[str]) -> _Beams:
    beams, rest = _stated_beams(words)
    return beams._replace(time=_seconds(rest[0]))


def _stated_beams(words: list[str]) -> tuple[_Beams, list[str]]:
    """Return the beams of a line RAWLASER1 or ROBOTLASER1, and the words after them."""
    first, field, step, most = map(float, words[2:6])
    count = int(words[8])
    ranges = np.array(words[9 : 9 + count], dtype=np.float64)
    rest = words[9 + count :]
    rest = rest[1 + int(rest[0]) :]
    angles: Array = first + (step or field / max(count - 1, 1)) * np.arange(count, dtype=np.float64)
    return _Beams(0, None, angles, ranges, most if most > 0.0 else MOST), rest


def _robotlaser(words: list[str]) -> _Beams:
    beams, rest = _stated_beams(words)
    laser, robot = _pose(rest[:3]), _pose(rest[3:6])
    return beams._replace(time=_seconds(rest[11]), odometry=robot, mounting=robot.to(laser))


def _seconds(word: str) -> Ns:
    return round(float(word) * S)


def _pose(words: Sequence[str]) -> Pose2:
    x, y, yaw = map(float, words)
    if not all(abs(value) <= FARTHEST for value in (x, y, yaw)):
        raise ValueError("no pose on Earth")
    return Pose2(x, y, yaw)


# -- bags


def _bag(path: Path, scan: str, odometry: str, of_camera: bool) -> LaserLog:
    from volery.ros.messages.bags import open_bag  # noqa: PLC0415  # rosbags is an extra, and slow to import

    bag = open_bag(path)
    topics = {topic.name: topic.type for topic in bag.topics}
    scans = _only(path, _depths_of(topics), _IMAGE, scan) if of_camera else _only(path, topics, _SCAN, scan)
    if not scans and of_camera and bag.omitted:
        raise UsageError(bag.omission(list(bag.omitted)))
    if not scans:
        listed = choices(topics) if topics else "none"
        has_pictures = not of_camera and _IMAGE in topics.values()
        hint = "; --from camera takes pictures" if has_pictures else ""
        raise UsageError(f"{path}: no topic of {_IMAGE if of_camera else _SCAN}; its topics: {listed}{hint}")
    named = f"/{odometry.removeprefix('/')}"
    moved = named if topics.get(named) == _POSE else _only(path, topics, _ODOMETRY, odometry)
    frames = [name for name, kind in topics.items() if kind == _TRANSFORMS]
    rigid = list(_transforms(bag.messages(frames))) if frames else []
    if moved:
        messages: Iterable[Any] = bag.messages([moved])
        places = [
            (_ns(message.message.header.stamp) or message.at, _rigid(message.message.pose))
            for message in messages
        ]
        words = moved
    else:
        places = [(at, one) for at, parent, _, one in rigid if parent.strip("/").rpartition("/")[2] == "odom"]
        words = "the transform from odom" if places else ""
    usable = [one for one in places if _is_usable(one[1])]
    if len(usable) < len(places):
        bag.damage.append(f"{len(places) - len(usable)} poses of {words} that are none are left out")
    places, words = usable, words if usable else ""
    if of_camera and not _is_of_depths(bag, scans):
        if not places:
            wanted = f"record {_ODOMETRY}, or the transform from odom"
            words = f"no odometry, without which pictures of one camera have no scale; {wanted}"
            raise UsageError("; ".join((f"{path}: {words}", *bag.damage)))
        return _of_views(path, bag, scans, rigid, places, words)
    poses = [(at, planar(one)) for at, one in places]
    mounted = {child.strip("/"): planar(one) for _, parent, child, one in rigid if "base" in parent}

    def of_scanner(message: Any) -> LaserScan2:
        return scan_of(message, mounted.get(message.header.frame_id.strip("/"), Pose2()))

    def of_depths(message: Any) -> LaserScan2:
        return depth_scan(message, view)

    if not of_camera:
        return LaserLog(_steps(bag.messages([scans]), poses, of_scanner, bag.damage), words, bag.damage)
    info, mounting = _camera(path, bag, scans, rigid)
    with _named(path):
        view = depth_view(info, mounting)
    steps = _steps(bag.messages([scans]), poses, of_depths, bag.damage)
    return LaserLog(steps, words, bag.damage, OF_CAMERA)


def _depths_of(topics: dict[str, str]) -> dict[str, str]:
    """Return the topics, of pictures those alone that are named as depths if there are such."""
    named = {name for name, kind in topics.items() if kind == _IMAGE and "depth" in name}
    return {name: kind for name, kind in topics.items() if kind != _IMAGE or not named or name in named}


def _is_of_depths(bag: Any, pictures: str) -> bool:
    """Return whether the pictures of a topic are depths, by the first; also if there is none."""
    return all(one.message.encoding in DEPTHS for one in islice(bag.messages([pictures]), 1))


_Transforms = list[tuple[Ns, str, str, RigidTransform]]


def _camera(path: Path, bag: Any, pictures: str, transforms: _Transforms) -> tuple[Any, RigidTransform]:
    """Return the calibration beside the pictures of a topic, and the transform from camera to vehicle."""
    beside = f"{pictures.rpartition('/')[0]}/camera_info"
    info = next((message.message for message in bag.messages([beside])), None)
    if info is None:
        raise UsageError(
            f"{path}: no calibration of {pictures}; record {beside} (sensor_msgs/CameraInfo), too"
        )
    above = {child.strip("/"): (parent.strip("/"), one) for _, parent, child, one in transforms}
    frame = info.header.frame_id.strip("/")
    mounting = AHEAD if frame not in above else RigidTransform((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for _ in above:  # no longer than a chain without a circle
        if "base" in frame or frame not in above:
            break
        frame, outer = above[frame]
        mounting = mounting.then(outer)
    return info, mounting


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Say in which recording an error of a message is."""
    try:
        yield
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None


def _of_views(
    path: Path,
    bag: Any,
    pictures: str,
    transforms: _Transforms,
    places: list[tuple[Ns, RigidTransform]],
    odometry: str,
) -> LaserLog:
    """Return the poses and scans that the pictures of one moving camera give."""
    from volery.autonomy.markers import camera_of, rectified_camera_of  # noqa: PLC0415  # OpenCV is an extra
    from volery.autonomy.motion_stereo import OF_VIEWS  # noqa: PLC0415

    info, mounting = _camera(path, bag, pictures, transforms)
    with _named(path):
        camera = (rectified_camera_of if "rect" in pictures.rpartition("/")[2] else camera_of)(info)
    size = int(info.height), int(info.width)
    steps = _views(bag.messages([pictures]), camera, size, mounting, places, bag.damage)
    return LaserLog(steps, f"{odometry}, corrected by the pictures", bag.damage, OF_VIEWS)


def _views(
    messages: Iterable[Any],
    camera: CameraModel,
    size: tuple[int, int],
    mounting: RigidTransform,
    places: list[tuple[Ns, RigidTransform]],
    damage: list[str],
) -> Iterator[LoggedScan]:
    from volery.autonomy.markers import picture_of  # noqa: PLC0415  # OpenCV is an extra
    from volery.autonomy.motion_stereo import MotionStereo  # noqa: PLC0415

    stereo = MotionStereo(camera, mounting)
    wrong: list[str] = []
    last: Ns | None = None
    for message in messages:
        time = _ns(message.message.header.stamp) or message.at
        try:
            picture = picture_of(message.message)
        except UsageError as error:
            wrong.append(str(error))
            continue
        if picture.shape != size:
            wrong.append(
                f"{picture.shape[1]} x {picture.shape[0]} with a calibration of {size[1]} x {size[0]}"
            )
        elif last is not None and time <= last:
            wrong.append("one that is not newer than the one before")
        else:
            last = time
            before, after, part = around(places, time)
            seen = stereo.add(time, picture, interpolate(before, after, part))
            if seen is not None:
                yield LoggedScan(*seen)
    if wrong:
        damage.append(f"{len(wrong)} pictures are left out, such as {wrong[0]}")


def _only(path: Path, topics: dict[str, str], kind: str, wanted: str) -> str:
    of_kind = sorted(name for name, one in topics.items() if one == kind)
    if wanted:
        name = wanted if wanted.startswith("/") else f"/{wanted}"
        if name not in of_kind:
            there = choices(of_kind) if of_kind else "none"
            raise UsageError(f"{path}: no topic {name} of {kind}; there is {there}")
        return name
    if len(of_kind) > 1:
        option = "--odometry" if kind == _ODOMETRY else "--scan"
        raise UsageError(f"{path}: several topics of {kind}; choose one by {option}: {', '.join(of_kind)}")
    return of_kind[0] if of_kind else ""


def _steps(
    messages: Iterable[Any],
    poses: list[tuple[Ns, Pose2]],
    taken: Callable[[Any], LaserScan2],
    damage: list[str],
) -> Iterator[LoggedScan]:
    wrong: list[str] = []
    for message in messages:
        try:
            scan = taken(message.message)
        except UsageError as error:
            wrong.append(str(error))
            continue
        time = scan.time or message.at
        yield LoggedScan(between(poses, time) if poses else None, scan._replace(time=time))
    if wrong:
        damage.append(f"{len(wrong)} messages that are no usable scan are left out, such as {wrong[0]}")


def between(poses: Sequence[tuple[Ns, Pose2]], time: Ns) -> Pose2:
    """Return the odometry at a time, between its messages in proportion; at its ends the nearest.

    Args:
        poses: At least one, by time.
        time: The time [ns].
    """
    before, after, part = around(poses, time)
    if part == 0.0:
        return before
    motion = before.to(after)
    return before.after(Pose2(part * motion.x, part * motion.y, part * motion.yaw))


def around(timed: Sequence[tuple[Ns, T]], time: Ns) -> tuple[T, T, float]:
    """Return what is before and after a time, and which part of the time between has passed.

    Args:
        timed: At least one, by time; before the first and after the last it is taken for both.
        time: The time [ns].
    """
    index = bisect_left(timed, time, key=itemgetter(0))
    if index in {0, len(timed)}:
        nearest = timed[min(index, len(timed) - 1)][1]
        return nearest, nearest, 0.0
    (start, before), (end, after) = timed[index - 1], timed[index]
    return before, after, (time - start) / (end - start)


def _ns(stamp: Any) -> Ns:
    seconds, rest = (stamp.sec, stamp.nanosec) if hasattr(stamp, "sec") else (stamp.secs, stamp.nsecs)
    return int(seconds) * S + int(rest)


def _rigid(pose: Any) -> RigidTransform:
    """Return a ``geometry_msgs/Pose``, with a covariance or without."""
    pose = getattr(pose, "pose", pose)
    place, turn = pose.position, pose.orientation
    return RigidTransform((turn.w, turn.x, turn.y, turn.z), (place.x, place.y, place.z))


def _is_usable(pose: RigidTransform) -> bool:
    """Return whether a pose has numbers of a vehicle on Earth, and a rotation."""
    length = np.linalg.norm(pose.rotation)
    return bool(0.5 < length < 2.0 and np.abs(pose.translation).max() <= FARTHEST)


def planar(rigid: RigidTransform) -> Pose2:
    """Return the part of a transform in the plane."""
    _, _, yaw = quaternion_to_euler(rigid.rotation)
    return Pose2(float(rigid.translation[0]), float(rigid.translation[1]), yaw)


def _transforms(messages: Iterable[Any]) -> Iterator[tuple[Ns, str, str, RigidTransform]]:
    """Yield time, parent, child and transform."""
    for message in messages:
        for moved in message.message.transforms:
            at = _ns(moved.header.stamp) or message.at
            yield at, moved.header.frame_id, moved.child_frame_id, from_transform(moved.transform)
