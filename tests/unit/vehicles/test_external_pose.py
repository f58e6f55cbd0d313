"""What an external pose may be, and how it becomes a message: frames, covariances, refusals."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan, radians
from typing import Any

import numpy as np
import pytest

from rigs.airstrip import Airstrip
from volery.base.errors import UsageError
from volery.base.frames import pose_covariance_ned_to_enu
from volery.base.position import AboveHome, Position
from volery.vehicles.drivers.ardupilot import open_driver
from volery.vehicles.external_pose import ExternalPose

LEVEL = [[0.01 if row == column else 0.0 for column in range(6)] for row in range(6)]
POSE = ExternalPose(1_500_000_000, 1.0, 2.0, 3.0, 90.0, LEVEL)


class ArduPilotStrip(Airstrip):
    firmware = "ardupilot"
    opener = staticmethod(open_driver)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"north": nan}, "north is nan; send nothing while the place is not known"),
        ({"heading": inf}, "heading is inf"),
        ({"up": None}, "up is None"),
        ({"east": 2e5}, "200000 m from the origin; give metres"),
        ({"heading": 1e3}, "give degrees"),
        ({"time": 1.5}, "the time 1.5; give whole nanoseconds"),
        ({"covariance": None}, "no covariance of 6 rows of 6"),
        ({"covariance": LEVEL[:5]}, "no covariance of 6 rows of 6"),
        ({"covariance": [[nan] * 6] * 6}, "not of finite numbers"),
        ({"covariance": [[0.0] * 6] * 6}, "variance 0 is 0; give one above 0"),
        ({"covariance": [[0.01, 0.005, *[0.0] * 4], *LEVEL[1:]]}, "not symmetric at 1, 0"),
        ({"covariance": [*LEVEL[:5], [*[0.0] * 5, 25.0]]}, "variance of the heading of 25; give rad²"),
    ],
)
def test_a_pose_that_is_none_is_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=said.replace(".", r"\.")):
        replace(POSE, **changed).check("craft_1")


def test_what_is_no_pose_or_origin_is_refused_before_anything_is_sent() -> None:
    def mission(drone: Any) -> None:
        with pytest.raises(UsageError, match="give an ExternalPose"):
            drone.send_external_pose((1.0, 2.0, 3.0))
        with pytest.raises(UsageError, match=r"give a Position with an altitude AMSL"):
            drone.set_origin(Position(46.0, -103.0, AboveHome(0.0)))

    ArduPilotStrip().fly(mission)


def test_a_place_on_a_map_whose_x_axis_points_to_the_east() -> None:
    plane = ((0.04, 0.01, 0.001), (0.01, 0.09, 0.002), (0.001, 0.002, 0.005))
    pose = ExternalPose.on_map(7, (3.0, 1.0, radians(30.0)), plane, up=1.5)
    pose.check("craft_1")
    assert (pose.north, pose.east, pose.up, pose.heading) == pytest.approx((1.0, 3.0, 1.5, 60.0))
    assert np.array(pose.covariance)[np.ix_((0, 1, 5), (0, 1, 5))] == pytest.approx(
        np.array(((0.09, 0.01, -0.002), (0.01, 0.04, -0.001), (-0.002, -0.001, 0.005)))
    )


def test_a_turned_map_turns_place_heading_and_covariance() -> None:
    plane = np.diag((0.04, 0.01, 0.005))
    pose = ExternalPose.on_map(7, (1.0, 0.0, 0.0), plane.tolist(), up=0.0, x_heading=45.0)
    half = 0.5**0.5
    assert (pose.north, pose.east, pose.heading) == pytest.approx((half, half, 45.0))
    assert pose.covariance[0][:2] == pytest.approx((0.025, 0.015))


def test_a_covariance_goes_to_enu_and_back() -> None:
    random = np.random.default_rng(3).normal(size=(6, 6))
    whole = (random @ random.T).ravel().tolist()
    turned = pose_covariance_ned_to_enu(whole)
    assert turned != pytest.approx(whole)
    assert pose_covariance_ned_to_enu(turned) == pytest.approx(whole)
    # a step to the north and down is one to y and against z
    assert turned[6 * 1 + 2] == pytest.approx(-whole[2])
