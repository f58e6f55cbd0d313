"""Real ROS 1 for campaigns. Without it tests skip; in CI they fail."""

from __future__ import annotations

import pytest

from rigs.requirements import lacking
from volery.base.errors import UsageError
from volery.calibration.ros.probe_environment import check_client


@pytest.fixture(scope="session")
def ros() -> None:
    try:
        check_client("rospy")
        check_client("roscpp")
    except UsageError as error:
        lacking(str(error))
