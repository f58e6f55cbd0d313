"""``/tf`` and ``/tf_static``: where the body is, in MAVROS's frames."""

from math import pi, sqrt
from typing import Any

import pytest

from volery.base import frames
from volery.base.frames import LocalFrame
from volery.base.time import MS

from .conftest import BridgeRig

TF = "tf2_msgs/TFMessage"
ORIGIN = LocalFrame(43.47, -3.83, 25.0)


def listening(topic: str, rig: BridgeRig) -> list[Any]:
    received: list[Any] = []
    rig.user.subscribe(topic, TF, received.append)
    return received


def placed(message: Any) -> tuple[str, str, tuple[float, float, float]]:
    [one] = message.transforms
    at = one.transform.translation
    return one.header.frame_id, one.child_frame_id, (at.x, at.y, at.z)


def turn(rotation: Any) -> tuple[float, float, float, float]:
    return rotation.w, rotation.x, rotation.y, rotation.z


def test_the_body_about_the_autopilots_own_origin(rig: BridgeRig) -> None:
    received = listening("/tf", rig)
    rig.connect()
    rig.emit("ATTITUDE", roll=0.0, pitch=0.0, yaw=pi / 2)
    rig.emit("LOCAL_POSITION_NED", x=3.0, y=5.0, z=-7.0)
    rig.run(200 * MS)
    [message] = received
    assert placed(message) == ("map", "drone_1/base_link", pytest.approx((5.0, 3.0, 7.0)))
    w, *rest = turn(message.transforms[0].transform.rotation)  # it looks to the east: no turn, in ENU
    assert (abs(w), *rest) == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-6)


def test_with_an_origin_all_vehicles_have_one_map() -> None:
    rig = BridgeRig(origin=ORIGIN)
    received = listening("/tf", rig)
    rig.connect()
    latitude, longitude, amsl = ORIGIN.from_enu((40.0, -9.0, 12.0))
    rig.emit("ATTITUDE", roll=0.0, pitch=0.0, yaw=0.0)
    rig.emit("LOCAL_POSITION_NED", x=0.0, y=0.0, z=0.0)
    place = {"lat": round(latitude * 1e7), "lon": round(longitude * 1e7), "alt": round(amsl * 1000)}
    rig.emit("GLOBAL_POSITION_INT", hdg=0, **place)
    rig.run(200 * MS)
    [message] = received
    assert placed(message) == ("map", "drone_1/base_link", pytest.approx((40.0, -9.0, 12.0), abs=0.02))


def test_without_an_attitude_there_is_no_transform(rig: BridgeRig) -> None:
    received = listening("/tf", rig)
    rig.connect()
    rig.emit("LOCAL_POSITION_NED", x=3.0, y=5.0, z=-7.0)
    rig.run(200 * MS)
    assert received == []


def test_static_transforms_are_published_once_and_latched(rig: BridgeRig) -> None:
    rig.connect()
    rig.heartbeat()
    rig.run(1000 * MS)
    received = listening("/tf_static", rig)
    rig.run(200 * MS)
    [message] = received
    found = {(one.header.frame_id, one.child_frame_id): one.transform.rotation for one in message.transforms}
    half = sqrt(0.5)
    assert turn(found["map", "map_ned"]) == pytest.approx((0.0, half, half, 0.0))
    assert turn(found["drone_1/base_link", "drone_1/base_link_frd"]) == (0.0, 1.0, 0.0, 0.0)


def test_static_frames_are_those_by_which_attitudes_are_converted() -> None:
    """A body in map is a body in map_ned seen through both static frames."""
    ned = frames.euler_to_quaternion(0.1, -0.2, 2.5)
    half = sqrt(0.5)
    through = frames.multiply(frames.multiply((0.0, half, half, 0.0), ned), (0.0, 1.0, 0.0, 0.0))
    assert through == pytest.approx(frames.attitude_ned_to_enu(ned))
