from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.autonomy.planar_pose import Pose2

poses = st.builds(Pose2, st.floats(-50, 50), st.floats(-50, 50), st.floats(-pi, pi))


@given(poses, poses)
def test_the_motion_between_two_poses_leads_from_one_to_the_other(one: Pose2, other: Pose2) -> None:
    found = one.after(one.to(other))
    assert found[:2] == pytest.approx(other[:2], abs=1e-9)
    assert abs((found.yaw - other.yaw + pi) % (2.0 * pi) - pi) < 1e-9


def test_points_of_a_pose_that_is_turned_to_the_left() -> None:
    assert Pose2(1.0, 2.0, pi / 2).of(np.array([[3.0, 0.0]])) == pytest.approx(np.array([[1.0, 5.0]]))
