"""ROS 1 passes the checks of transports, on a real master with real rospy."""

from dataclasses import replace

import pytest

from volery.base.errors import UsageError
from volery.ros.messages import ros1_type
from volery.testing.transport_conformance import CHECKS, ROS1, Site

from .conftest import Ours

pytestmark = pytest.mark.integration


def carries(name: str) -> bool:
    try:
        ros1_type(name)
    except UsageError:
        return False
    return name != "sensor_msgs/msg/Range"  # its variance is newer than ROS 1 and is left out


@pytest.mark.parametrize("check", CHECKS)
def test_encodings_ros1(check: str, ours: Ours) -> None:
    with Site(ours.graph, check, replace(ROS1, carries=carries)) as site:
        CHECKS[check](site)
