"""A node that has a map of a file: ``map``, latched, and the services ``static_map`` and ``load_map``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.planar_pose import Array
from volery.base.elementary import sine_cosine
from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.ros.graph import LATCHED, Node
from volery.ros.messages import new

SUCCESS, NOT_THERE, INVALID = 0, 1, 3
"""Results of ``load_map``."""


class MapServer:
    """A map of a file on a graph, in the callbacks of a node that its owner spins.

    Args:
        node: The node.
        file: The map's YAML file.
        frame: Frame of the map.
        topic: Topic of the map.
        say: Called with why a map was not loaded.

    ``grid`` is the map.

    Raises:
        UsageError: The file is not a map.
    """

    def __init__(
        self,
        node: Node,
        file: Path,
        frame: str = "map",
        topic: str = "map",
        say: Callable[[str], object] = lambda text: None,
    ) -> None:
        self._node, self._frame, self._say = node, frame, say
        self.grid = OccupancyGrid.load(file)
        self._maps = node.advertise(topic, "nav_msgs/msg/OccupancyGrid", LATCHED)
        node.serve("static_map", "nav_msgs/srv/GetMap", self._give)
        node.serve("load_map", "nav2_msgs/srv/LoadMap", self._load)
        self._maps.publish(self._message())

    def _message(self) -> Any:
        message = new("nav_msgs/msg/OccupancyGrid")
        fill_header(message.header, self._node.now(), self._frame)
        self.grid.fill(message)
        return message

    def _give(self, request: Any) -> Any:
        return new("nav_msgs/srv/GetMap_Response", map=self._message())

    def _load(self, request: Any) -> Any:
        answer = new("nav2_msgs/srv/LoadMap_Response")
        try:
            file = map_path(request.map_url).with_suffix(".yaml")
            answer.result = INVALID if file.exists() else NOT_THERE
            self.grid = OccupancyGrid.load(file)
        except (OSError, UsageError) as error:
            self._say(f"load_map {request.map_url!r}: {error}")
            return answer
        answer.result, answer.map = SUCCESS, self._message()
        self._maps.publish(answer.map)
        return answer


def map_path(url: str) -> Path:
    """Return the path of a map without the ending of its files: of a path or a URL ``file:``.

    Raises:
        UsageError: It names no file.
    """
    parts = urlsplit(url)
    if parts.scheme not in ("", "file"):
        raise UsageError(f"a map of the scheme {parts.scheme}; give a path or file://PATH")
    path = Path(unquote(parts.path) if parts.scheme else url)
    if not path.name:
        raise UsageError("no name of a map; give a path")
    return path.with_suffix("") if path.suffix in {".yaml", ".yml", ".pgm"} else path


def path_message(at: Ns, places: Array, frame: str = "map", times: Sequence[Ns] = ()) -> Any:
    """Return the ``nav_msgs/Path`` of places (n, 2) [m] or poses (n, 3) [m, m, rad] at ROS time *at* [ns].

    ``times`` are those of the poses [ns], where they were passed; by default all have the time *at*.
    """
    path = new("nav_msgs/msg/Path")
    fill_header(path.header, at, frame)
    stamps = zip(places, times or repeat(at), strict=False)
    path.poses.extend(pose_message(time, place, frame) for place, time in stamps)
    return path


def pose_message(at: Ns, place: Sequence[float] | Array, frame: str = "map") -> Any:
    """Return the ``geometry_msgs/PoseStamped`` of a place [m] or pose [m, m, rad] at ROS time *at* [ns]."""
    message = new("geometry_msgs/msg/PoseStamped")
    fill_header(message.header, at, frame)
    message.pose.position.x, message.pose.position.y = float(place[0]), float(place[1])
    yaw = float(place[2]) if len(place) > 2 else 0.0
    message.pose.orientation.z, message.pose.orientation.w = sine_cosine(0.5 * yaw)
    return message


def fill_header(header: Any, at: Ns, frame: str = "") -> None:
    """Write ROS time *at* [ns] and a frame into a header."""
    header.stamp.sec, header.stamp.nanosec = divmod(at, S)
    header.frame_id = frame
