"""What nodes published of maps: the last map, path and scan of each topic, and the last recorded picture.

A map lies in a frame of its own. Where the node of a map also publishes the way that it has come (a
``nav_msgs/Path`` whose poses have times), the map is placed so that this way lies on the true track of a
vehicle; otherwise its frame is taken for the world's.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from math import ceil, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.laser_scan import scan_of
from volery.autonomy.planar_pose import Pose2
from volery.base.errors import UsageError
from volery.base.frames import quaternion_to_euler
from volery.base.time import Ns, to_seconds
from volery.ros.messages import from_cdr
from volery.ros.messages.message import nanoseconds
from volery.trace.events import Published

Json = dict[str, Any]
Floats = NDArray[np.float64]

_MAP, _PATH = "nav_msgs/msg/OccupancyGrid", "nav_msgs/msg/Path"
_SCAN, _PICTURE = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/Image"
_TRANSFORMS, _STATIC = "tf2_msgs/msg/TFMessage", "/tf_static"
_MOST_TOPICS = 12  # of a kind
_MOST_CELLS = 1 << 19  # of a map that is drawn; a larger one is drawn coarser
_MOST_POINTS = 1500
_MOST_COLUMNS = 480  # of a picture
_UNIX: Ns = 10**17  # stamps above it are Unix time
_SPREAD = 0.5  # [m] from which on the form of a way says how it is turned


class TrueTrack(NamedTuple):
    """Where a vehicle was: times [s], places as complex numbers east + north i [m], yaw [rad]."""

    times: Floats
    places: NDArray[np.complex128]
    yaws: Floats

    def at(self, times: Floats) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return places and directions at times, between the states in proportion."""
        known = np.stack((self.places, np.exp(1j * self.yaws)))
        places, directions = (
            np.interp(times, self.times, row.real) + 1j * np.interp(times, self.times, row.imag)
            for row in known
        )
        return places, directions


class _Way(NamedTuple):
    """A path: seconds of its poses (none if they have no times), places and directions."""

    times: Floats
    places: NDArray[np.complex128]
    directions: NDArray[np.complex128]


class _Placement(NamedTuple):
    """Where a frame lies in the world, and whose track it was placed on, with the error of the fit [m]."""

    origin: complex = 0j
    turn: complex = 1 + 0j
    vehicle: str = ""
    error: float = 0.0

    def of(self, places: NDArray[np.complex128]) -> NDArray[np.complex128]:
        moved: NDArray[np.complex128] = self.origin + self.turn * places
        return moved


class PublishedMaps:
    """Listener of ``Published`` that keeps the last message of each topic a report draws."""

    def __init__(self) -> None:
        self._last: dict[str, dict[str, Published]] = {_MAP: {}, _PATH: {}, _SCAN: {}, _PICTURE: {}}
        self._static: list[Published] = []

    def __call__(self, event: Published) -> None:
        """Keep a message if it is drawn; its content is not read before the end."""
        kept = self._last.get(event.type)
        if kept is not None:
            if event.topic in kept or len(kept) < _MOST_TOPICS:
                kept[event.topic] = event
        elif event.type == _TRANSFORMS and event.topic == _STATIC:
            self._static.append(event)

    def data(self, tracks: Mapping[str, TrueTrack]) -> Json:
        """Return what is drawn as JSON values.

        Args:
            tracks: Where each vehicle was, by its name; of real ones that is not known.
        """
        decoded = {kind: self._decoded(kind) for kind in self._last}
        ways = {event.topic: _way(event, message) for event, message in decoded[_PATH]}
        maps: list[Json] = []
        placements: dict[tuple[str, str], _Placement] = {}
        for event, message in decoded[_MAP]:
            of_node = [
                ways[one.topic]
                for one, path in decoded[_PATH]
                if one.publisher == event.publisher and path.header.frame_id == message.header.frame_id
            ]
            placement = _placed(of_node, tracks)
            drawn = _map(event, message, placement)
            if drawn is not None:
                maps.append(drawn)
                placements.setdefault((event.publisher, message.header.frame_id), placement)
        by_frame = {frame: placement for (_, frame), placement in reversed(placements.items())}
        paths = []
        for event, message in decoded[_PATH]:
            frame = message.header.frame_id
            own = placements.get((event.publisher, frame), by_frame.get(frame, _Placement()))
            paths.append(_path(event, ways[event.topic], own))
        mounted = self._mounted()
        scans = [_scan(event, message, tracks, mounted) for event, message in decoded[_SCAN]]
        pictures = [_picture(event, message) for event, message in decoded[_PICTURE]]
        return {
            "maps": maps,
            "paths": [path for path in paths if len(path["points"]) > 1],
            "scans": [scan for scan in scans if scan],
            "pictures": [picture for picture in pictures if picture],
        }

    def _decoded(self, kind: str) -> list[tuple[Published, Any]]:
        """Return the last messages of a type; without those of another definition of it."""
        messages = []
        for event in self._last[kind].values():
            try:
                messages.append((event, from_cdr(kind, event.data)))
            except UsageError:
                continue
        return messages

    def _mounted(self) -> dict[str, Pose2]:
        """Return the pose of each frame in the one at the root of its vehicle."""
        above: dict[str, tuple[str, Pose2]] = {}
        for event in self._static:
            try:
                message = from_cdr(_TRANSFORMS, event.data)
            except UsageError:
                continue
            for each in message.transforms:
                place = each.transform.translation
                planar = Pose2(place.x, place.y, _yaw(each.transform.rotation))
                above[each.child_frame_id] = each.header.frame_id, planar
        mounted = {}
        for frame in above:
            pose, parent = Pose2(), frame
            for _ in above:  # no longer than a chain without a circle
                if parent not in above:
                    break
                parent, planar = above[parent]
                pose = planar.after(pose)
            mounted[frame] = pose
        return mounted


def _yaw(turn: Any) -> float:
    _, _, yaw = quaternion_to_euler((turn.w, turn.x, turn.y, turn.z))
    return yaw


def _from_start(stamp: Ns, event: Published) -> float:
    """Return the seconds of the run of a stamp; on the wall clock stamps are in Unix time."""
    return to_seconds(event.at if stamp > _UNIX else stamp)


def _way(event: Published, message: Any) -> _Way:
    rows = [
        (nanoseconds(pose.header.stamp), complex(pose.pose.position.x, pose.pose.position.y), pose.pose)
        for pose in message.poses
    ]
    stamps = [stamp for stamp, _, _ in rows]
    ended = nanoseconds(message.header.stamp)
    has_times = len(set(stamps)) > 1 and min(stamps) > 0 and max(stamps) <= ended
    # the clock of the stamps may be Unix time: the message itself was sent at the time of its event
    times = [to_seconds(event.at - (ended - stamp)) for stamp in stamps] if has_times else []
    places = np.array([place for _, place, _ in rows], dtype=np.complex128)
    directions = np.array([np.exp(1j * _yaw(pose.orientation)) for *_, pose in rows], dtype=np.complex128)
    usable = np.isfinite(places) & np.isfinite(directions)
    return _Way(np.array(times)[usable] if times else np.zeros(0), places[usable], directions[usable])


def _placed(ways: list[_Way], tracks: Mapping[str, TrueTrack]) -> _Placement:
    """Return where the frame of ways lies: the way that fits a vehicle's track best counts."""
    fits = [
        _fit(way, name, track)
        for way in ways
        if len(way.times)
        for name, track in tracks.items()
        if len(track.times)
    ]
    return min(fits, key=lambda fit: fit.error, default=_Placement())


def _fit(way: _Way, vehicle: str, track: TrueTrack) -> _Placement:
    """Return the rotation and shift of least squares from a way to a track."""
    places, directions = track.at(way.times)
    ours, theirs = way.places - way.places.mean(), places - places.mean()
    spread = sqrt(float(np.mean(np.abs(ours) ** 2)))
    turned = np.vdot(ours, theirs) if spread > _SPREAD else np.vdot(way.directions, directions)
    turn = complex(turned / abs(turned)) if abs(turned) > 0.0 else 1 + 0j
    error = sqrt(float(np.mean(np.abs(theirs - turn * ours) ** 2)))
    return _Placement(complex(places.mean() - turn * way.places.mean()), turn, vehicle, error)


def _map(event: Published, message: Any, placement: _Placement) -> Json | None:
    """Return a map with its cells as runs: level (0 free to 10 occupied, -1 unknown) and number."""
    info = message.info
    corner, turn = complex(info.origin.position.x, info.origin.position.y), _yaw(info.origin.orientation)
    if not np.isfinite((corner, turn, info.resolution)).all() or not 0.0 < info.resolution < 1e6:
        return None
    if not 0 < len(message.data) == info.width * info.height:
        return None
    cells = np.asarray(message.data, dtype=np.int8).reshape(info.height, info.width)
    together = ceil(sqrt(cells.size / _MOST_CELLS))
    cells = _coarser(cells, together)
    known = (cells >= 0) & (cells <= 100)
    levels = np.where(known, np.round(cells / 10.0), -1).astype(np.int64)
    flat = levels.ravel()
    starts = np.flatnonzero(np.diff(flat, prepend=flat[0] + 1))
    runs = np.stack((flat[starts], np.diff(starts, append=len(flat))), axis=1)
    place = placement.of(np.array([corner]))[0]
    yaw = np.angle(placement.turn) + turn
    return {
        "topic": event.topic,
        "node": event.publisher,
        "t": round(to_seconds(event.at), 3),
        "rows": cells.shape[0],
        "columns": cells.shape[1],
        "side": float(info.resolution) * together,
        "x": round(place.real, 3),
        "y": round(place.imag, 3),
        "yaw": round(float(yaw), 5),
        "runs": runs.ravel().tolist(),
        "vehicle": placement.vehicle,
        "error": round(placement.error, 3),
    }


def _coarser(cells: NDArray[np.int8], together: int) -> NDArray[np.int8]:
    """Return cells of so many on each side; each is as occupied as the most occupied one in it."""
    if together == 1:
        return cells
    rows, columns = (ceil(count / together) for count in cells.shape)
    padding = [(0, size * together - count) for size, count in zip((rows, columns), cells.shape, strict=True)]
    padded = np.pad(cells, padding, constant_values=-1)
    most: NDArray[np.int8] = padded.reshape(rows, together, columns, together).max(axis=(1, 3))
    return most


def _path(event: Published, way: _Way, placement: _Placement) -> Json:
    return {
        "topic": event.topic,
        "t": round(to_seconds(event.at), 3),
        "past": bool(len(way.times)),
        "points": _pairs(placement.of(way.places)),
    }


def _pairs(places: NDArray[np.complex128]) -> list[list[float]]:
    """Return places as pairs of metres, at most so many as a screen shows."""
    kept = np.append(places[:: ceil(len(places) / _MOST_POINTS) or 1], places[-1:])
    pairs: list[list[float]] = np.round(np.stack((kept.real, kept.imag), axis=1), 2).tolist()
    return pairs


def _scan(
    event: Published, message: Any, tracks: Mapping[str, TrueTrack], mounted: Mapping[str, Pose2]
) -> Json | None:
    """Return where the beams of a scan ended, seen from where its vehicle really was."""
    named = event.topic.lstrip("/").partition("/")[0]
    vehicle = named if named in tracks else next(iter(tracks)) if len(tracks) == 1 else ""
    if not vehicle or not len(tracks[vehicle].times):
        return None
    try:
        scan = scan_of(message, mounted.get(message.header.frame_id, Pose2()))
    except UsageError:
        return None
    time = _from_start(nanoseconds(message.header.stamp), event)
    (place,), (direction,) = tracks[vehicle].at(np.array([time]))
    points = place + direction / max(abs(direction), 1e-9) * (scan.points[:, 0] + 1j * scan.points[:, 1])
    seen = _pairs(points[np.isfinite(points)])
    return {"topic": event.topic, "t": round(time, 3), "vehicle": vehicle, "points": seen}


_CHANNELS: Mapping[str, tuple[str, int, tuple[int, ...]]] = {
    "mono8": ("u1", 1, (0,)),
    "8UC1": ("u1", 1, (0,)),
    "rgb8": ("u1", 3, (0, 1, 2)),
    "bgr8": ("u1", 3, (2, 1, 0)),
    "rgba8": ("u1", 4, (0, 1, 2)),
    "bgra8": ("u1", 4, (2, 1, 0)),
    "mono16": ("u2", 1, (0,)),
    "16UC1": ("u2", 1, (0,)),
    "32FC1": ("f4", 1, (0,)),
}
"""Type of a value, values of a pixel, and which of them are grey or red, green and blue, by encoding."""


def _picture(event: Published, message: Any) -> Json | None:
    """Return a picture in bytes of grey, or of red, green and blue; depths are near bright to far dark."""
    if message.encoding not in _CHANNELS:
        return None
    kind, count, order = _CHANNELS[message.encoding]
    raw = np.asarray(message.data, dtype=np.uint8)
    width = count * np.dtype(kind).itemsize * message.width
    if not (0 < width <= message.step and message.height > 0) or len(raw) < message.step * message.height:
        return None
    every = ceil(message.width / _MOST_COLUMNS)
    lines = raw[: message.step * message.height].reshape(message.height, message.step)[::every, :width]
    typed = np.ascontiguousarray(lines).view(
        np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    )
    values = typed.reshape(len(lines), message.width, count)[:, ::every, order]
    if kind != "u1":
        values = _as_grey(values.astype(np.float64), message.encoding != "mono16")
    return {
        "topic": event.topic,
        "t": round(_from_start(nanoseconds(message.header.stamp), event), 3),
        "rows": values.shape[0],
        "columns": values.shape[1],
        "channels": values.shape[2],
        "pixels": b64encode(values.astype(np.uint8).tobytes()).decode(),
    }


def _as_grey(values: Floats, is_depth: bool) -> Floats:
    """Return 0 to 255; of depths the nearest is the brightest, and what is unknown is black."""
    known = np.isfinite(values) & (values > 0.0)
    if not known.any():
        return np.zeros_like(values)
    low, high = float(values[known].min()), float(values[known].max())
    share = (np.where(known, values, low) - low) / max(high - low, 1e-9)
    shade: Floats = np.where(known, 40.0 + 215.0 * (1.0 - share if is_depth else share), 0.0)
    return shade
