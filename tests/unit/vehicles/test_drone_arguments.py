"""Arguments of the flying API that are of a wrong type: an error of the project that names what to write."""

import re
from collections.abc import Iterator

import pytest

from volery import Drone, connect
from volery.base.errors import UsageError


@pytest.fixture(scope="module")
def drone() -> Iterator[Drone]:
    with connect("sim:ardupilot") as found:
        yield found


@pytest.mark.parametrize("goal", ["north", (46, 7, 10), (46.0, 7.0), None])
def test_a_goal_is_a_position(drone: Drone, goal: object) -> None:
    said = re.escape(f"goto({goal!r}): a goal is a Position, as in goto(Position(")
    with pytest.raises(UsageError, match=said):
        drone.goto(goal)  # type: ignore[arg-type]


@pytest.mark.parametrize("height", ["10", None, (10,)])
def test_a_height_is_a_number(drone: Drone, height: object) -> None:
    said = re.escape(f"takeoff({height!r}): {height!r} is not a finite number; write it as in takeoff(10)")
    with pytest.raises(UsageError, match=said):
        drone.takeoff(height)  # type: ignore[arg-type]
