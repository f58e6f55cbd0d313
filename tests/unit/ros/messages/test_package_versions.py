"""Definitions of older versions: px4_msgs."""

import subprocess
import sys

import pytest

from volery.base.errors import UsageError
from volery.ros.messages.package_versions import use_version, versions_of

VERSIONS = """
from volery.ros.messages.package_versions import use_version
from volery.ros.messages.px4_constants import topic_name
from volery.ros.messages import message_class
use_version("px4_msgs", {version!r})
print(topic_name("out", "vehicle_status", "VehicleStatus"))
print(topic_name("in", "vehicle_attitude_setpoint", "VehicleAttitudeSetpoint"))
print("latitude_deg" in message_class("px4_msgs/msg/SensorGps").__match_args__)
try:
    use_version("px4_msgs", "1.17" if {version!r} != "1.17" else "1.14")
except Exception as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("version", "status", "attitude", "degrees"),
    [
        ("1.14", "vehicle_status", "vehicle_attitude_setpoint", False),
        ("1.15", "vehicle_status", "vehicle_attitude_setpoint", True),
        ("1.16", "vehicle_status_v1", "vehicle_attitude_setpoint", True),
        ("1.17", "vehicle_status_v1", "vehicle_attitude_setpoint_v1", True),
    ],
)
def test_types_decide_the_names_of_topics(version: str, status: str, attitude: str, degrees: bool) -> None:
    command = [sys.executable, "-c", VERSIONS.format(version=version)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert lines[:3] == [f"fmu/out/{status}", f"fmu/in/{attitude}", str(degrees)]
    assert f"this process has messages of {version} already" in lines[3]


def test_a_version_that_there_is_not() -> None:
    assert versions_of("std_msgs") == ()
    with pytest.raises(UsageError, match=r"no version '1\.2'; there is 1\.14, 1\.15, 1\.16 or 1\.17"):
        use_version("px4_msgs", "1.2")
