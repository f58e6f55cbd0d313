"""Controlled quantities in records of every kind."""

from __future__ import annotations

from math import radians
from pathlib import Path

import numpy as np
import pytest

from rigs.flight_log_files import dataflash, tlog, ulog, yaw_quaternion
from volery.base.errors import UsageError
from volery.base.time import MS
from volery.control.log_signals import chosen_signal, euler_degrees, read_signals
from volery.control.step_response import step_responses
from volery.links.frame import Frame
from volery.ros import messages
from volery.ros.messages.bags import create_bag
from volery.trace.attachments import RunSetup
from volery.trace.events import ControlSample
from volery.trace.mcap_writer import McapWriter

TIMES = np.arange(0.0, 12.0, 0.05)
YAW = 90.0 * (1.0 - np.exp(-np.maximum(TIMES - 2.0, 0.0) / 0.5))
GOAL = np.where(TIMES >= 2.0, 90.0, 0.0)
BEAT = Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "custom_mode": 4, "mavlink_version": 3}, 1, 1)


def dataflash_log(folder: Path) -> Path:
    rows = zip(TIMES, *[np.zeros_like(TIMES)] * 4, GOAL, YAW, strict=True)
    return dataflash(folder / "1.bin", {"ATT": ("DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw", rows)})


def ulog_log(folder: Path) -> Path:
    def rows(values):
        return [(time, *yaw_quaternion(yaw)) for time, yaw in zip(TIMES, values, strict=True)]

    tables = {
        "vehicle_attitude": ("float[4] q", rows(YAW)),
        "vehicle_attitude_setpoint": ("float[4] q_d", rows(GOAL)),
    }
    return ulog(folder / "1.ulg", tables)


def tlog_log(folder: Path) -> Path:
    frames = [(0.0, BEAT)]
    for time, yaw, goal in zip(TIMES, YAW, GOAL, strict=True):
        frames.append((time, Frame("ATTITUDE", {"time_boot_ms": 1, "yaw": radians(yaw)}, 1, 1)))
        frames.append((time, Frame("ATTITUDE_TARGET", {"q": yaw_quaternion(goal)}, 1, 1)))
    return tlog(folder / "1.tlog", frames)


def bag_log(folder: Path) -> Path:
    with create_bag(folder / "1.bag") as bag:
        for time, yaw, goal in zip(TIMES, YAW, GOAL, strict=True):
            at = round(time * 1000) * MS
            for topic, value in (("/drone/pose", yaw), ("/drone/setpoint", goal)):
                message = messages.new("geometry_msgs/PoseStamped")
                w, _, _, z = yaw_quaternion(value)
                message.pose.orientation.w, message.pose.orientation.z = w, z
                bag.write(topic, at, message)
    return folder / "1.bag"


def run_folder(folder: Path) -> Path:
    writer = McapWriter(folder / "trace.mcap", RunSetup("flight", "code"))
    for time, yaw, goal in zip(TIMES, YAW, GOAL, strict=True):
        at = round(time * 1000) * MS
        terms = goal - yaw, 2.0 * (goal - yaw), 0.0, 0.0, 2.0 * (goal - yaw)
        writer(ControlSample(at, "drone", "yaw", "P", "deg", 360.0, goal, yaw, *terms))
    writer.close()
    return folder


@pytest.mark.parametrize("record", [dataflash_log, ulog_log, tlog_log, bag_log, run_folder])
def test_the_same_turn_has_the_same_figures_in_every_format(tmp_path: Path, record) -> None:
    (yaw,) = (one for one in read_signals(record(tmp_path)) if one.name.endswith("yaw"))
    assert yaw.period == 360.0
    (turn,) = step_responses(yaw)
    assert turn.size == pytest.approx(90.0, abs=0.1)
    assert turn.settled_10 == pytest.approx(0.5 * np.log(10.0), abs=0.06)
    assert turn.start == pytest.approx(2.0, abs=0.06)


def test_a_run_states_its_controller(tmp_path: Path) -> None:
    assert [one.controller for one in read_signals(run_folder(tmp_path))] == ["P"]


def test_columns_can_be_chosen(tmp_path: Path) -> None:
    signal = chosen_signal(dataflash_log(tmp_path), "ATT.Yaw", "ATT.DesYaw", "deg")
    assert len(step_responses(signal)) == 1
    bag = chosen_signal(bag_log(tmp_path), "/drone/pose.pose.orientation.z")
    assert len(bag.times) == len(TIMES)


def test_a_column_that_is_missing_is_named_with_those_that_exist(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no column 'ATT.Yawn'; it has ATT.DesRoll"):
        chosen_signal(dataflash_log(tmp_path), "ATT.Yawn")


def test_a_log_without_attitude_is_refused(tmp_path: Path) -> None:
    path = dataflash(tmp_path / "1.bin", {"BARO": ("Alt", [(0.0, 1.0)])})
    with pytest.raises(UsageError, match="no message among ATT"):
        read_signals(path)


def test_a_run_without_vehicles_is_refused(tmp_path: Path) -> None:
    McapWriter(tmp_path / "trace.mcap", RunSetup("flight", "code")).close()
    with pytest.raises(UsageError, match="neither a control loop nor a vehicle"):
        read_signals(tmp_path)


@pytest.mark.parametrize("pitch", [89.99, 90.0, -90.0, 45.0, 0.0])
def test_the_poles_of_a_quaternion_are_finite_and_right(pitch: float) -> None:
    half, turn = radians(pitch) / 2.0, radians(30.0) / 2.0
    # yaw 30 degrees, then pitch
    w, x = np.cos(turn) * np.cos(half), -np.sin(turn) * np.sin(half)
    y, z = np.cos(turn) * np.sin(half), np.sin(turn) * np.cos(half)
    roll, found, yaw = euler_degrees(*(np.array([one]) for one in (w, x, y, z)))
    assert found[0] == pytest.approx(pitch, abs=0.1)
    assert (yaw[0] - roll[0] * np.sign(pitch) if abs(pitch) > 80 else yaw[0]) == pytest.approx(30.0, abs=0.1)


def test_disarmed_stretches_of_each_format_are_known(tmp_path: Path) -> None:
    """Armed at 4 s, in the air at 6 s, landed at 9 s and disarmed at 10 s."""
    att = [(time, 0.0, 0.0) for time in TIMES]
    events = [(4.0, 10.0), (6.0, 28.0), (9.0, 18.0), (10.0, 11.0)]
    bin_log = dataflash(tmp_path / "1.bin", {"ATT": ("DesYaw,Yaw", att), "EV": ("Id", events)})
    poses = [(time, *yaw_quaternion(0.0)) for time in TIMES]
    states = {
        "vehicle_attitude": ("float[4] q", poses),
        "vehicle_status": ("float arming_state", [(0.0, 1.0), (4.0, 2.0), (10.0, 1.0)]),
        "vehicle_land_detected": ("float landed", [(0.0, 1.0), (6.0, 0.0), (9.0, 1.0)]),
    }
    beats = [(0.0, 0), (1.0, 0), (4.0, 128), (10.0, 0)]
    frames = [(at, Frame("HEARTBEAT", {**BEAT.fields, "base_mode": mode}, 1, 1)) for at, mode in beats]
    for at, landed in ((0.0, 1), (6.0, 2), (9.0, 1)):
        frames.append((at, Frame("EXTENDED_SYS_STATE", {"vtol_state": 0, "landed_state": landed}, 1, 1)))
    frames += [(time, Frame("ATTITUDE", {"time_boot_ms": 1, "yaw": 0.0}, 1, 1)) for time in TIMES]
    with create_bag(tmp_path / "1.bag") as bag:
        for time in TIMES:
            bag.write("/a/mavros/pose", round(time * 1000) * MS, messages.new("geometry_msgs/PoseStamped"))
        for at, mode in beats:
            state = messages.new("mavros_msgs/State", armed=mode > 0)
            bag.write("/a/mavros/state", round(at * 1000) * MS, state)
        for at, landed in ((0, 1), (6, 2), (9, 1)):
            bag.write(
                "/a/mavros/extended_state",
                at * 1000 * MS,
                messages.new("mavros_msgs/ExtendedState", landed_state=landed),
            )
    logs = [
        bin_log,
        ulog(tmp_path / "1.ulg", states),
        tlog(tmp_path / "1.tlog", sorted(frames, key=lambda one: one[0])),
        tmp_path / "1.bag",
    ]
    for log in logs:
        (yaw,) = (one for one in read_signals(log) if one.name.endswith("yaw"))
        assert not yaw.engaged
        for why, begins, ends in (("disarmed", 10.0, 4.0), ("on the ground", 9.0, 6.0)):
            (before, after) = (one for one in yaw.idle if one.why == why)
            assert before.end == pytest.approx(ends), log
            assert (before.start <= 0.0, after.end) == (True, np.inf)
            assert after.start == pytest.approx(begins), log


def test_a_step_of_a_tlog_is_dated_when_its_command_was_sent(tmp_path: Path) -> None:
    """The set-point is reported four times a second, the turn commanded at 2.0 s."""
    frames = [(0.0, BEAT)]
    turn = {"target_system": 1, "target_component": 1, "command": 115, "confirmation": 0, "param1": 90.0}
    frames.append((2.0, Frame("COMMAND_LONG", turn, 255, 190)))
    for time, yaw in zip(TIMES, YAW, strict=True):
        frames.append((time, Frame("ATTITUDE", {"time_boot_ms": 1, "yaw": radians(yaw)}, 1, 1)))
    for time in np.arange(0.2, 12.0, 0.25):
        bearing = 90 if time > 2.0 else 0
        frames.append((time, Frame("NAV_CONTROLLER_OUTPUT", {"nav_bearing": bearing}, 1, 1)))
    for command, resolution in ((True, 0.0), (False, 0.25)):
        sent = [one for one in frames if command or one[1].name != "COMMAND_LONG"]
        path = tlog(tmp_path / "1.tlog", sorted(sent, key=lambda one: one[0]))
        (yaw,) = (one for one in read_signals(path) if one.name == "yaw")
        (turned,) = step_responses(yaw)
        assert turned.start == pytest.approx(2.0 if command else 2.2, abs=1e-6)
        assert turned.resolution == pytest.approx(resolution, abs=1e-6)


def test_each_vehicle_of_a_tlog_has_its_own_signals(tmp_path: Path) -> None:
    frames = [(0.0, Frame("HEARTBEAT", BEAT.fields, system, 1)) for system in (1, 2)]
    for time, yaw in zip(TIMES, YAW, strict=True):
        for system, value in ((1, 0.0), (2, yaw)):
            frames.append((time, Frame("ATTITUDE", {"time_boot_ms": 1, "yaw": radians(value)}, system, 1)))
    signals = {one.name: one for one in read_signals(tlog(tmp_path / "1.tlog", frames))}
    assert {"yaw", "vehicle2 yaw"} <= set(signals)
    assert step_responses(signals["yaw"]) == []
    (turned,) = step_responses(signals["vehicle2 yaw"])
    assert turned.size == pytest.approx(90.0, abs=1.0)
