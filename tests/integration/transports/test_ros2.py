"""Real rclpy, Jazzy and Kilted, each in an environment and processes of its own."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import Any

import pytest

from volery.testing.transport_conformance import CHECKS

from .conftest import HERE, LIMIT_S, python_of, surroundings

pytestmark = pytest.mark.integration

DISTRIBUTIONS = ("jazzy", "kilted")
FAULTS = (
    "fault-a-type-without-support",
    "fault-a-type-with-other-fields",
    "fault-fields-of-this-distribution",
    "fault-a-flood",
    "fault-a-message-that-is-none",
    "fault-a-subscriber-that-never-reads",
    "fault-another-type-on-our-topic",
    "fault-a-thousand-topics",
    "fault-a-part-that-cannot-be-taken",
    "fault-a-node-that-cannot-be-destroyed",
    "the-end",
)


@cache
def findings(distribution: str) -> dict[str, str]:
    """What the checks have found, by their names."""
    done = subprocess.run(
        [python_of(distribution), str(HERE / "ros2_checks.py")],
        env=surroundings(),
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, str] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("check", [*CHECKS, *FAULTS])
@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_ros2(distribution: str, check: str) -> None:
    assert findings(distribution)[check] == ""


@contextmanager
def our_node(distribution: str, around: Mapping[str, str]) -> Iterator[list[str]]:
    """Our node in a process of its own; gives the types that it takes."""
    process = subprocess.Popen(
        [python_of(distribution), str(HERE / "ros2_ours.py")],
        env=around,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "ready\n"
        names = []
        while not names or names[-1] != "std_msgs/msg/UInt8MultiArray":  # the last of them
            names.append(process.stdout.readline().strip())
        yield names
        process.stdin.write("x")
        process.stdin.flush()
        assert process.wait(LIMIT_S) == 0
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(("ours", "theirs"), [("jazzy", "jazzy"), ("kilted", "kilted"), ("jazzy", "kilted")])
def test_plain_rclpy_exchanges_all_types_with_us(ours: str, theirs: str) -> None:
    around = surroundings()
    with our_node(ours, around) as names:
        done = subprocess.run(
            [python_of(theirs), str(HERE / "rclpy_peer.py"), *names],
            env=around,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
        assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout)
    assert len(names) > 80
    assert found["changed"] == []
    assert found["answer"] == [True, "by volery"]
    assert found["report"] == ["True by rclpy"]
    assert found["rate"] == 10
    assert {"/drone_1/mavros", "/peer"} <= set(found["nodes"])
    assert found["topics"]["/back/sensor_msgs/msg/Imu"] == ["sensor_msgs/msg/Imu"]
    assert "/drone_1/arm" in found["served"]
