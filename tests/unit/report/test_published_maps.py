"""Maps, paths, scans and pictures of a report: where they lie, what is left out, what a browser gets."""

from __future__ import annotations

from base64 import b64decode
from typing import Any

import numpy as np
import pytest

from volery.autonomy.map_server import path_message
from volery.base.time import S
from volery.report.digest import Digest
from volery.report.html_report import ReportContent, render
from volery.report.published_maps import PublishedMaps, TrueTrack
from volery.requirements.accounts import Accounts
from volery.ros.messages import new, to_cdr
from volery.testing.sample_run import sample_setup
from volery.trace.events import Published

MAP, PATH, SCAN = "nav_msgs/msg/OccupancyGrid", "nav_msgs/msg/Path", "sensor_msgs/msg/LaserScan"
IMAGE, TRANSFORMS = "sensor_msgs/msg/Image", "tf2_msgs/msg/TFMessage"
TURN = 0.4
SECONDS = np.arange(1.0, 21.0)
OWN = np.stack((SECONDS, 0.1 * SECONDS**2, np.arctan(0.2 * SECONDS)), axis=1)
"""Poses of a vehicle in the frame of its map, whose origin is at (7, -3) in the world, turned by ``TURN``."""


def in_world(places: Any) -> Any:
    return 7.0 - 3.0j + np.exp(1j * TURN) * (places[:, 0] + 1j * places[:, 1])


TRACKS = {
    "drone": TrueTrack(SECONDS, in_world(OWN) + 30.0 + SECONDS**1.5, OWN[:, 2]),
    "rover": TrueTrack(SECONDS, in_world(OWN), OWN[:, 2] + TURN),
}


def sent(topic: str, message: Any, at: int = 20 * S, node: str = "/slam") -> Published:
    return Published(at, topic, message.__msgtype__, node, to_cdr(message))


def grid(cells: Any, side: float = 0.5, x: float = -1.0, y: float = 2.0) -> Any:
    message = new(MAP)
    rows, columns = cells.shape
    message.header.frame_id = "map"
    message.info.resolution, message.info.width, message.info.height = side, columns, rows
    message.info.origin.position.x, message.info.origin.position.y = x, y
    message.info.origin.orientation.w = 1.0
    message.data = cells.astype(np.int8).ravel()
    return message


def way(poses: Any = OWN, stamped: bool = True) -> Any:
    times = [int(second) * S for second in SECONDS] if stamped else []
    return path_message(20 * S, poses, "map", times)


def drawn(*events: Published) -> Any:
    maps = PublishedMaps()
    for event in events:
        maps(event)
    return maps.data(TRACKS)


CELLS = np.array(((-1, -1, 0, 4), (100, 97, 55, 0), (0, 0, -1, 101)))


def test_a_map_lies_where_the_way_of_its_node_fits_a_track() -> None:
    data = drawn(sent("/map", grid(CELLS)), sent("/path", way()))
    (found,) = data["maps"]
    corner = in_world(np.array(((-1.0, 2.0),)))[0]
    assert (found["x"], found["y"]) == pytest.approx((corner.real, corner.imag), abs=2e-3)
    assert found["yaw"] == pytest.approx(TURN, abs=1e-4)
    assert (found["vehicle"], found["error"]) == ("rover", 0.0)
    (path,) = data["paths"]
    assert path["past"]
    assert path["points"][-1] == pytest.approx([in_world(OWN)[-1].real, in_world(OWN)[-1].imag], abs=0.01)


def test_a_vehicle_that_has_not_moved_says_by_its_heading_how_a_map_is_turned() -> None:
    standing = np.repeat(OWN[:1], len(SECONDS), axis=0)
    maps = PublishedMaps()
    maps(sent("/map", grid(CELLS)))
    maps(sent("/path", way(standing)))
    place = in_world(standing)
    (found,) = maps.data({"rover": TrueTrack(SECONDS, place, standing[:, 2] + TURN)})["maps"]
    assert found["yaw"] == pytest.approx(TURN, abs=1e-4)


@pytest.mark.parametrize("node", ["/slam", "/planner"])
def test_without_a_way_with_times_the_frame_of_a_map_is_the_worlds(node: str) -> None:
    data = drawn(sent("/map", grid(CELLS)), sent("/plan", way(stamped=False), node=node))
    (found,), (path,) = data["maps"], data["paths"]
    assert (found["x"], found["y"], found["yaw"], found["vehicle"]) == (-1.0, 2.0, 0.0, "")
    assert not path["past"]
    assert path["points"][0] == pytest.approx(OWN[0, :2].tolist(), abs=0.01)


def test_a_plan_of_another_node_lies_in_the_map_of_its_frame() -> None:
    plan = sent("/plan", way(OWN[:2], stamped=False), node="/planner")
    data = drawn(sent("/map", grid(CELLS)), sent("/path", way()), plan)
    start = in_world(OWN)[0]
    assert data["paths"][1]["points"][0] == pytest.approx([start.real, start.imag], abs=0.01)


def test_the_runs_of_a_map_are_its_cells() -> None:
    (found,) = drawn(sent("/map", grid(CELLS)))["maps"]
    levels = np.repeat(found["runs"][::2], found["runs"][1::2]).reshape(3, 4)
    assert levels.tolist() == [[-1, -1, 0, 0], [10, 10, 6, 0], [0, 0, -1, -1]]


def test_a_large_map_is_drawn_coarser_and_keeps_its_walls() -> None:
    cells = np.zeros((1500, 1000))
    cells[701, 333] = 100
    (found,) = drawn(sent("/map", grid(cells)))["maps"]
    levels = np.repeat(found["runs"][::2], found["runs"][1::2]).reshape(found["rows"], found["columns"])
    assert levels.size <= 1 << 19
    assert found["rows"] * found["side"] == pytest.approx(750.0, abs=found["side"])
    assert np.argwhere(levels == 10).tolist() == [[350, 166]]


def test_the_last_scan_is_drawn_from_where_its_vehicle_was() -> None:
    static = new(TRANSFORMS, transforms=[new("geometry_msgs/msg/TransformStamped")])
    (mounted,) = static.transforms
    mounted.header.frame_id, mounted.child_frame_id = "base_link", "lidar"
    mounted.transform.translation.x, mounted.transform.rotation.w = 0.5, 1.0
    scans = []
    for time, reach in ((5, 3.0), (9, 2.0)):
        message = new(SCAN, angle_increment=0.1, range_max=10.0, ranges=[reach, float("inf"), float("nan")])
        message.header.frame_id, message.header.stamp.sec = "lidar", time
        scans.append(sent("/rover/scan", message, time * S, "/rover/sensors"))
    (found,) = drawn(sent("/tf_static", static), *scans)["scans"]
    pose = in_world(OWN)[8] + 2.5 * np.exp(1j * (OWN[8, 2] + TURN))
    assert found["t"] == 9.0
    assert found["points"][0] == pytest.approx([pose.real, pose.imag], abs=0.01)


def test_pictures_become_bytes() -> None:
    colour = new(IMAGE, height=1, width=2, encoding="bgr8", step=8)
    colour.data = np.array((1, 2, 3, 4, 5, 6, 0, 0), dtype=np.uint8)
    depth = new(IMAGE, height=1, width=3, encoding="16UC1", step=6, is_bigendian=1)
    depth.data = np.frombuffer(np.array((0, 1000, 3000), dtype=">u2").tobytes(), dtype=np.uint8)
    data = drawn(sent("/colour", colour), sent("/depth", depth))["pictures"]
    assert [list(b64decode(one["pixels"])) for one in data] == [[3, 2, 1, 6, 5, 4], [0, 255, 40]]


def test_what_cannot_be_drawn_is_left_out_and_the_page_is_made() -> None:
    cut, endless, empty = grid(CELLS), grid(CELLS, side=float("inf")), new(MAP)
    cut.data = cut.data[:-1]
    nowhere = OWN.copy()
    nowhere[3:5] = float("nan")
    short = new(IMAGE, height=9, width=9, encoding="mono8", step=9, data=[1])
    strange = new(IMAGE, height=1, width=1, encoding="bayer_rggb8", step=1, data=[1])
    events = [
        *(sent(f"/map{number}", message) for number, message in enumerate((cut, endless, empty))),
        sent("/path", way(nowhere)),
        sent("/short", short),
        sent("/strange", strange),
        sent("/scan", new(SCAN, range_min=2.0, range_max=1.0)),
        Published(20 * S, "/other", MAP, "/slam", b"\0\1\0\0no map"),
    ]
    data = drawn(*events)
    assert data["maps"] == data["scans"] == data["pictures"] == []
    assert len(data["paths"][0]["points"]) > 15
    setup = sample_setup()
    digest, accounts = Digest(setup, None), Accounts(setup)
    for event in events:
        digest(event)
    assert "/path" in render(ReportContent(accounts.record("completed"), digest.data(20.0)))
