from __future__ import annotations

from itertools import pairwise
from math import hypot, nan

import numpy as np
import pytest

from volery.autonomy.avoidance import Motion
from volery.autonomy.laser_scan import LaserScan2, scan_from_ranges
from volery.autonomy.navigator import Navigator
from volery.autonomy.planar_pose import Pose2
from volery.base.errors import UsageError
from volery.base.time import MS, S

ANGLES = np.radians(np.arange(-180.0, 180.0, 2.0))
DRONE = Motion(radius=0.3, speed=3.0, acceleration=3.0, sight=15.0)
NOWHERE = np.zeros(2)


def ranges(walls: np.ndarray, pose: Pose2) -> np.ndarray:
    """Return where the beams meet walls (n, 4): both ends."""
    along = np.stack((np.cos(pose.yaw + ANGLES), np.sin(pose.yaw + ANGLES)), axis=1)
    side, start = walls[:, 2:] - walls[:, :2], walls[:, :2] - (pose.x, pose.y)
    with np.errstate(divide="ignore", invalid="ignore"):
        across = along[:, :1] * side[:, 1] - along[:, 1:] * side[:, 0]
        length = (start[:, 0] * side[:, 1] - start[:, 1] * side[:, 0]) / across
        share = (start[:, 0] * along[:, 1:] - start[:, 1] * along[:, :1]) / across
    found: np.ndarray = np.where((length > 0.0) & (share >= 0.0) & (share <= 1.0), length, np.inf).min(axis=1)
    return found


def scan(walls: np.ndarray, pose: Pose2, time: int) -> LaserScan2:
    return scan_from_ranges(time, ANGLES, ranges(walls, pose), 0.05, DRONE.sight)


def closed(west: float, south: float, east: float, north: float) -> list[tuple[float, ...]]:
    corners = [(west, south), (east, south), (east, north), (west, north), (west, south)]
    return [(*one, *other) for one, other in pairwise(corners)]


ROOM = np.array([*closed(0.0, 0.0, 20.0, 12.0), (10.0, 0.0, 10.0, 8.0), (5.0, 12.0, 5.0, 5.0)])
"""A room with two walls that stand in the way, one from each side."""


def fly(navigator: Navigator, walls: np.ndarray, start: Pose2, seconds: float) -> np.ndarray:
    """Return the places of a vehicle that does what it is commanded, 0.2 s later."""
    place, velocity, places = np.array(start[:2]), np.zeros(2), [np.array(start[:2])]
    commands = [velocity] * 4
    for tick in range(round(seconds / 0.05)):
        time = tick * 50 * MS
        if tick % 2 == 0:
            pose = Pose2(*place, start.yaw)
            command = navigator.update(time, pose, scan(walls, pose, time), velocity)
        commands.append(command)
        change = commands.pop(0) - velocity
        after = velocity + change * min(1.0, DRONE.acceleration * 0.05 / max(hypot(*change), 1e-12))
        place, velocity = place + 0.025 * (velocity + after), after
        places.append(place)
        if navigator.arrived:
            break
    return np.array(places)


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_it_finds_its_way_around_walls_that_it_did_not_know(yaw: float) -> None:
    navigator = Navigator(DRONE, (18.0, 2.0))
    places = fly(navigator, ROOM, Pose2(2.0, 10.0, yaw), 60.0)
    assert navigator.arrived
    assert navigator.word == "arrived"
    assert places[-1] == pytest.approx((18.0, 2.0), abs=0.4)
    for wall in ROOM:
        side = wall[2:] - wall[:2]
        share = np.clip((places - wall[:2]) @ side / (side @ side), 0.0, 1.0)
        assert np.hypot(*(places - wall[:2] - share[:, None] * side).T).min() > DRONE.radius + 0.1
    assert np.hypot(*np.diff(places, axis=0).T).sum() < 1.3 * 31.0


def test_the_same_flight_twice_is_the_same_to_the_last_bit() -> None:
    one, other = (fly(Navigator(DRONE, (18.0, 2.0)), ROOM, Pose2(2.0, 10.0), 3.0).tobytes() for _ in range(2))
    assert one == other


def test_it_says_when_there_is_no_way_and_stays() -> None:
    navigator = Navigator(DRONE, (18.0, 2.0))
    walled = np.array([*closed(0.0, 0.0, 20.0, 12.0), (10.0, 0.0, 10.0, 12.0)])
    places = fly(navigator, walled, Pose2(5.0, 6.0), 1.0)
    assert navigator.word.startswith("no way to (18.0, 2.0)")
    assert places[-1] == pytest.approx((5.0, 6.0), abs=1.0)
    navigator.goal = (9.9, 6.0)
    fly(navigator, walled, Pose2(5.0, 6.0), 0.3)
    assert navigator.word.startswith("no way: the goal is 0.")
    navigator.goal = (8.0, 9.0)
    fly(navigator, walled, Pose2(5.0, 6.0), 20.0)
    assert navigator.arrived


def test_it_leaves_a_gap_that_is_too_narrow_to_be_chosen() -> None:
    gap = 2.0 * DRONE.room + 0.12
    walls = np.array(
        [*closed(0.0, 0.0, 20.0, 12.0), *closed(4.0, 0.0, 8.0, 6.0), *closed(4.0, 6.0 + gap, 8.0, 12.0)]
    )
    navigator = Navigator(DRONE, (15.0, 6.0))
    assert 2.0 * navigator.least > gap
    fly(navigator, walls, Pose2(6.0, 6.0 + 0.5 * gap), 30.0)
    assert navigator.arrived


def test_it_brakes_when_the_lidar_is_silent_and_goes_on_afterwards() -> None:
    navigator, pose = Navigator(DRONE, (18.0, 10.0)), Pose2(7.0, 10.0)
    assert not navigator.update(0, pose, None, NOWHERE).any()
    assert navigator.word == "no scan yet"
    old = scan(ROOM, pose, 100 * MS)
    assert navigator.update(100 * MS, pose, old, NOWHERE).any()
    assert navigator.update(400 * MS, pose, None, NOWHERE).any()
    assert not navigator.update(700 * MS, pose, old, NOWHERE).any()
    assert navigator.word == "no scan for more than 0.5 s"
    assert navigator.update(S, pose, scan(ROOM, pose, S), NOWHERE).any()
    assert navigator.word == "on the way"


def test_it_brakes_when_the_scan_says_nothing_or_denies_what_was_seen() -> None:
    navigator, pose = Navigator(DRONE, (18.0, 10.0)), Pose2(7.0, 10.0)
    blind = scan_from_ranges(0, ANGLES, np.full(len(ANGLES), nan), 0.05, 15.0)
    assert not navigator.update(0, pose, blind, NOWHERE).any()
    assert "no beam is a number" in navigator.word
    assert navigator.update(S, pose, scan(ROOM, pose, S), NOWHERE).any()
    before = navigator.grid.log_odds.copy()
    nothing = scan_from_ranges(S + 100 * MS, ANGLES, np.full(len(ANGLES), np.inf), 0.05, 15.0)
    assert not navigator.update(S + 100 * MS, pose, nothing, NOWHERE).any()
    assert "all maximum" in navigator.word
    assert (navigator.grid.log_odds == before).all()


def test_it_brakes_when_the_scan_is_stuck_and_goes_on_when_it_changes() -> None:
    navigator, pose, fast = Navigator(DRONE, (18.0, 10.0)), Pose2(7.0, 10.0), np.array((1.0, 0.0))
    stuck = scan(ROOM, pose, 0)

    def goes(tick: int, velocity: np.ndarray) -> bool:
        time = tick * 100 * MS
        return bool(navigator.update(time, pose, stuck._replace(time=time), velocity).any())

    assert all(goes(tick, NOWHERE) for tick in range(8)), "a vehicle that stands sees the same"
    assert [goes(8 + tick, fast) for tick in range(5)] == [True, True, False, False, False]
    assert navigator.word == "the scan does not change although the vehicle moves: it is stuck"
    assert not goes(13, NOWHERE)
    moved = Pose2(7.5, 10.0)
    assert navigator.update(1400 * MS, moved, scan(ROOM, moved, 1400 * MS), NOWHERE).any()


@pytest.mark.parametrize(("off", "word"), [(-5 * S, "5 s old"), (5 * S, "5 s ahead of the clock")])
def test_it_brakes_when_the_stamps_are_of_another_time(off: int, word: str) -> None:
    navigator, pose = Navigator(DRONE, (18.0, 10.0)), Pose2(7.0, 10.0)
    assert navigator.update(10 * S, pose, scan(ROOM, pose, 10 * S), NOWHERE).any()
    assert not navigator.update(11 * S, pose, scan(ROOM, pose, 11 * S + off), NOWHERE).any()
    assert navigator.word == f"the scan is {word}"
    assert navigator.update(12 * S, pose, scan(ROOM, pose, 12 * S), NOWHERE).any()


def test_it_goes_on_when_the_whole_clock_jumps_back() -> None:
    navigator, pose = Navigator(DRONE, (18.0, 10.0)), Pose2(7.0, 10.0)
    assert navigator.update(3600 * S, pose, scan(ROOM, pose, 3600 * S), NOWHERE).any()
    assert not navigator.update(0, pose, None, NOWHERE).any()
    assert navigator.word == "no scan yet"
    assert navigator.update(S, pose, scan(ROOM, pose, S), NOWHERE).any()
    assert not navigator.update(2 * S, pose, None, NOWHERE).any()
    assert navigator.word == "no scan for more than 0.5 s"


def test_an_open_field_is_flown_although_every_beam_is_at_its_maximum() -> None:
    navigator = Navigator(DRONE, (6.0, 0.0))
    nothing = scan_from_ranges(0, ANGLES, np.full(len(ANGLES), 15.0), 0.05, 15.0)
    assert navigator.update(0, Pose2(), nothing, NOWHERE)[0] > 2.0


def test_what_is_no_number_brakes_or_is_refused() -> None:
    navigator, pose = Navigator(DRONE, (18.0, 10.0)), Pose2(7.0, 10.0)
    assert not navigator.update(0, Pose2(nan, 0.0), scan(ROOM, pose, 0), NOWHERE).any()
    assert not navigator.update(0, pose, scan(ROOM, pose, 0), np.array((nan, 0.0))).any()
    assert navigator.word == "pose or velocity is not a number"
    with pytest.raises(UsageError, match="finite"):
        navigator.goal = (nan, 0.0)
    navigator.goal = None
    assert not navigator.update(0, pose, scan(ROOM, pose, 0), NOWHERE).any()
    assert navigator.word == "no goal"
