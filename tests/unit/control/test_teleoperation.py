"""Teleoperation: dead man, limits, a real terminal, a device that is unplugged."""

from __future__ import annotations

import os
import re
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.base.errors import UsageError, VehicleError
from volery.base.time import MS, S
from volery.control.actuation import VelocitySetpoints
from volery.control.teleoperation import (
    DEAD_MAN,
    LAND,
    QUIT,
    SILENT_POLLS,
    Intent,
    Joystick,
    Keyboard,
    Teleoperator,
    TeleopLimits,
    teleoperate,
)
from volery.run.connect import connect

LIMITS = TeleopLimits(speed=2.0, climb=1.0, turn=45.0, change_s=0.5)
AHEAD = Intent(forward=1.0)
shares = st.floats(-5.0, 5.0)


def test_the_command_rises_and_falls_at_a_limited_rate() -> None:
    operator = Teleoperator(LIMITS)
    operator.command(0, 0.0)
    seen = []
    for tick in range(1, 31):
        now = tick * 100 * MS
        if tick <= 10:
            operator.receive(Intent(forward=1.0), now)
        seen.append(operator.command(now, 0.0).north)
    assert seen[:5] == pytest.approx([0.4, 0.8, 1.2, 1.6, 2.0])
    assert seen[9 + DEAD_MAN // (100 * MS)] == pytest.approx(2.0)  # the last moment that a held key counts
    assert seen[-1] == 0.0


@given(st.lists(st.tuples(shares, shares, shares, shares), min_size=1, max_size=20), st.floats(0, 360))
def test_no_input_exceeds_the_limits(inputs, heading) -> None:
    operator = Teleoperator(LIMITS)
    for tick, one in enumerate(inputs):
        operator.receive(Intent(*one), tick * 100 * MS)
        command = operator.command(tick * 100 * MS, heading)
        assert (command.north**2 + command.east**2) ** 0.5 <= 2.0 * 2**0.5 + 1e-9
        assert abs(command.up) <= 1.0
        assert abs(command.yaw_rate) <= 45.0


def test_forward_is_where_the_drone_looks() -> None:
    operator = Teleoperator(LIMITS)
    operator.command(0, 90.0)
    operator.receive(Intent(forward=1.0), S)
    command = operator.command(S, 90.0)
    assert command.east == pytest.approx(2.0)
    assert command.north == pytest.approx(0.0, abs=1e-9)


def test_keys_of_a_terminal() -> None:
    ours, theirs = os.openpty()
    keys = Keyboard(theirs)
    import tty

    tty.setcbreak(theirs)
    assert keys.poll() is None
    os.write(ours, b"w?d")
    assert keys.poll() == Intent(right=1.0)  # the newest that has a meaning
    os.write(ours, b"wl")
    assert keys.poll() == LAND
    os.write(ours, b"x")
    assert keys.poll() == QUIT
    os.close(ours)
    os.close(theirs)


def event(value: int, kind: int, number: int) -> bytes:
    return struct.pack("<IhBB", 0, value, kind, number)


def test_a_joystick_needs_its_dead_man_button(tmp_path: Path) -> None:
    path = tmp_path / "js0"
    os.mkfifo(path)
    stick = Joystick(path)
    writer = os.open(path, os.O_WRONLY)
    os.write(writer, event(-32767, 2, 4))  # right stick forward
    assert stick.poll() is None
    os.write(writer, event(1, 1, 4))
    assert stick.poll() == Intent(forward=1.0)
    os.write(writer, event(1000, 2, 4))  # within the dead zone
    assert stick.poll() == Intent()
    os.write(writer, event(0, 1, 4))
    assert stick.poll() is None
    os.write(writer, event(1, 1, 1))
    assert stick.poll() == LAND
    os.close(writer)
    with pytest.raises(VehicleError, match="unplugged"):
        stick.poll()
    stick.close()


def test_a_joystick_that_falls_silent_with_a_deflected_stick_counts_for_nothing(tmp_path: Path) -> None:
    """It reports changes only: a steady hand and a dead device look alike."""
    path = tmp_path / "js0"
    os.mkfifo(path)
    stick = Joystick(path)
    writer = os.open(path, os.O_WRONLY)
    os.write(writer, event(1, 1, 4) + event(-32767, 2, 4))
    polled = [stick.poll() for _ in range(SILENT_POLLS + 1)]
    assert polled == [Intent(forward=1.0)] * SILENT_POLLS + [None]
    os.write(writer, event(-32000, 2, 4))  # the hand moves: it goes on
    assert stick.poll() == Intent(forward=32000 / 32767)
    os.close(writer)
    stick.close()


def test_a_missing_joystick_and_wrong_limits_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="js7"):
        Joystick(tmp_path / "js7")
    with pytest.raises(UsageError, match="speed=0"):
        TeleopLimits(speed=0.0)


class Scripted:
    """Holds a key for some time, then does what is given; a real drone and link are behind it."""

    def __init__(self, held: Intent, polls: int, end: str | VehicleError) -> None:
        self._held, self._polls, self._end = held, polls, end

    def poll(self) -> Intent | str | None:
        self._polls -= 1
        if self._polls > 0:
            return self._held
        if isinstance(self._end, VehicleError):
            raise self._end
        return self._end


def test_a_key_moves_the_drone_and_l_lands_it() -> None:
    with connect("sim:ardupilot?start=warm") as drone:
        start = drone.position
        said: list[str] = []
        source = Scripted(AHEAD, 30, LAND)
        ended = teleoperate(drone, source, VelocitySetpoints(drone), LIMITS, 3.0, said.append)
        assert ended == LAND
        line = r"GUIDED · \d\.\d m above home · [12]\.\d m/s · battery \d+% · [1-9] m from home"
        assert any(re.fullmatch(line, one) for one in said), said
        assert not drone.armed
        assert (drone.position.latitude - start.latitude) * 111e3 > 2.0


def test_an_unplugged_joystick_stops_and_lands_the_drone() -> None:
    gone = VehicleError("teleoperation", "the joystick", "it was unplugged")
    with connect("sim:ardupilot?start=warm") as drone:
        ended = teleoperate(drone, Scripted(AHEAD, 20, gone), VelocitySetpoints(drone), LIMITS, 3.0)
        assert "unplugged" in ended
        assert not drone.armed
