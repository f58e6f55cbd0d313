"""References of a twin, and its tracking error in flight."""

from __future__ import annotations

from collections.abc import Callable
from math import nan, radians
from pathlib import Path

import numpy as np
import pytest

from rigs.controlled_flights import fly_watched
from rigs.flight_log_files import tlog, yaw_quaternion
from volery.base.errors import UsageError
from volery.base.time import MS
from volery.control.digital_twin import (
    RecordedReference,
    Twin,
    TwinReference,
    recorded_reference,
    tracking_errors,
)
from volery.control.log_signals import read_signals
from volery.control.step_response import ControlledSignal, make_signal
from volery.links.frame import Frame
from volery.ros import messages
from volery.ros.messages.bags import create_bag

TIMES = np.arange(0.0, 40.0, 0.1)


def record(height: float = 6.0) -> list[ControlledSignal]:
    up = np.clip(TIMES - 5.0, 0.0, height)
    north = 100.0 + np.clip(TIMES - 15.0, 0.0, 10.0)
    yaw = np.where(TIMES < 20.0, 350.0, (350.0 + np.clip(TIMES - 20.0, 0.0, 2.0) * 15.0) % 360.0)
    columns = {"yaw": yaw, "north": north, "east": np.full_like(TIMES, 7.0), "altitude": up + 900.0}
    return [
        make_signal(
            name, "deg" if name == "yaw" else "m", (TIMES, values), period=360.0 if name == "yaw" else None
        )
        for name, values in columns.items()
    ]


def test_a_record_becomes_a_reference_about_its_own_start() -> None:
    reference = recorded_reference(record())
    first, late = reference(0.0), reference(15.0)
    assert first is not None
    assert late is not None
    assert (first.north, first.east, first.up) == pytest.approx((0.0, 0.0, 1.5), abs=0.06)
    assert late.velocity_north == pytest.approx(1.0, abs=0.05)
    assert late.turn_rate == pytest.approx(15.0, abs=1.0)
    assert 350.0 < late.heading < 381.0  # it goes on through north
    assert reference(reference.duration + 0.1) is None


def bag_log(folder: Path) -> Path:
    """Write a flight that climbs, moves north and turns from north to east, as MAVROS publishes poses."""
    with create_bag(folder / "1.bag") as bag:
        for time in np.arange(0.0, 20.0, 0.05):
            message = messages.new("geometry_msgs/PoseStamped")
            at = message.pose.position
            at.x, at.y, at.z = 3.0, float(max(0.0, time - 10.0)), float(min(time, 5.0))
            w, _, _, z = yaw_quaternion(90.0 - min(90.0, 9.0 * time))  # ENU: counter-clockwise from east
            message.pose.orientation.w, message.pose.orientation.z = w, z
            bag.write("/mavros/local_position/pose", round(float(time) * 1000) * MS, message)
    return folder / "1.bag"


def tlog_log(folder: Path) -> Path:
    """Write the same flight as an autopilot sends it over MAVLink."""
    frames = [
        (0.0, Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "custom_mode": 4, "mavlink_version": 3}, 1, 1))
    ]
    for time in map(float, np.arange(0.0, 20.0, 0.05)):
        yaw = radians(min(90.0, 9.0 * time))
        frames.append((time, Frame("ATTITUDE", {"time_boot_ms": 1, "yaw": yaw}, 1, 1)))
        place = {"x": max(0.0, time - 10.0), "y": 3.0, "z": -min(time, 5.0)}
        frames.append((time, Frame("LOCAL_POSITION_NED", place, 1, 1)))
    return tlog(folder / "1.tlog", frames)


@pytest.mark.parametrize("log", [bag_log, tlog_log])
def test_a_bag_and_a_tlog_are_the_same_reference(tmp_path: Path, log: Callable[[Path], Path]) -> None:
    reference = recorded_reference(read_signals(log(tmp_path)))
    first, late = reference(0.0), reference(15.0)
    assert first is not None
    assert late is not None
    assert first.up == pytest.approx(1.5, abs=0.1)
    assert first.heading == pytest.approx(9.0 * 1.5, abs=1.0)
    assert first.turn_rate == pytest.approx(9.0, abs=0.5)
    assert late.heading == pytest.approx(90.0, abs=0.5)
    assert (late.east, late.up) == pytest.approx((0.0, 5.0), abs=0.05)
    assert late.north == pytest.approx(1.5 + 15.0 - 10.0, abs=0.1)
    assert late.velocity_north == pytest.approx(1.0, abs=0.05)


def test_a_log_that_is_cut_within_a_frame_is_a_reference_until_there(tmp_path: Path) -> None:
    whole = tlog_log(tmp_path)
    whole.write_bytes(whole.read_bytes()[: -len(whole.read_bytes()) // 4 - 7])
    reference = recorded_reference(read_signals(whole))
    assert 10.0 < reference.duration < 15.0


def test_a_record_in_which_nothing_flies_or_lacks_a_quantity_is_refused() -> None:
    with pytest.raises(UsageError, match="nothing flies"):
        recorded_reference(record(height=0.5))
    with pytest.raises(UsageError, match="has no north"):
        recorded_reference([one for one in record() if one.name != "north"])


def test_a_twin_follows_a_record() -> None:
    reference: RecordedReference = recorded_reference(record())
    flown = fly_watched(lambda: Twin(reference), limit_s=120.0)
    assert flown.error is None
    assert not flown.end.armed
    loops: dict[str, list] = {}
    for one in flown.samples:
        if one.controller == "twin":
            loops.setdefault(one.loop, []).append(one)
    signals = [
        ControlledSignal(
            name,
            rows[0].unit,
            np.array([one.at / 1e9 for one in rows]),
            np.array([one.measurement for one in rows]),
            np.array([one.goal for one in rows]),
            rows[0].period or None,
            "twin",
        )
        for name, rows in loops.items()
    ]
    errors = {one.quantity: one for one in tracking_errors(signals)}
    assert errors["horizontal"].rms < 0.5
    assert errors["altitude"].rms < 0.6
    assert errors["yaw"].rms < 6.0


def test_a_twin_that_is_far_behind_brakes_before_its_reference() -> None:
    """50 m behind a reference that stands: at 8 m/s it would pass it by far."""
    flown = fly_watched(
        lambda: Twin(lambda elapsed: TwinReference(0.0, 50.0, 0.0, 5.0) if elapsed < 25.0 else None),
        limit_s=120.0,
    )
    assert flown.error is None
    north = [one for one in flown.samples if one.loop == "north" and one.controller == "twin"]
    assert max(one.measurement for one in north) < 51.0
    assert abs(north[-1].error) < 0.5


def test_without_a_reference_the_twin_hovers() -> None:
    twin = Twin(lambda _: TwinReference(nan, nan, nan, nan, nan, nan, nan))
    from volery.control.actuation import MeasuredState

    command, _ = twin.step(MeasuredState(10.0, 1.0, 2.0, 5.0, 0.0, 0.0, 0.0), 0.05)
    assert tuple(command)[:2] == (0.0, 0.0)
    assert command.yaw_rate == 0.0
