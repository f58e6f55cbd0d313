"""Teleoperation by keyboard or joystick: what the operator presses becomes a limited command.

A key must be repeated, or a button of the joystick held (dead man): half a second after the last input the
command goes to zero at a limited rate, and the drone hovers. A joystick reports changes only, so one that
fails with its stick deflected looks like a steady hand: after three seconds without a report it counts as no
input. Commands are sent ten times a second at most, and only the last input counts, so that a slow link never
works off a queue of old ones.
"""

from __future__ import annotations

import os
import select
import struct
import sys
import termios
import tty
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import hypot, nan, radians
from pathlib import Path
from typing import NamedTuple, Protocol

from volery.base.elementary import cos, sin
from volery.base.errors import UsageError, VehicleError
from volery.base.frames import LocalFrame
from volery.base.time import MS, Ns, from_seconds, to_seconds
from volery.control.actuation import Actuation, MeasuredState, MotionCommand
from volery.kernel.waiting import Rate
from volery.vehicles import Drone
from volery.vehicles.telemetry import Telemetry

PERIOD: Ns = 100 * MS
SHOWN: Ns = 500 * MS
"""Time between two lines about the flight."""
DEAD_MAN: Ns = 500 * MS
"""Time after the last input from which the command goes to zero."""


class Intent(NamedTuple):
    """What the operator wants, each -1..1: forward, right, up, turn clockwise."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    turn: float = 0.0


NOTHING = Intent()
LAND, QUIT = "land", "quit"
KEYS: Mapping[str, Intent | str] = {
    "w": Intent(forward=1.0),
    "s": Intent(forward=-1.0),
    "d": Intent(right=1.0),
    "a": Intent(right=-1.0),
    "r": Intent(up=1.0),
    "f": Intent(up=-1.0),
    "e": Intent(turn=1.0),
    "q": Intent(turn=-1.0),
    " ": NOTHING,
    "l": LAND,
    "x": QUIT,
    "\x03": QUIT,
}
HELP = "w s a d move · r f climb, descend · q e turn · space stop · l land · x quit; hold the key"


@dataclass(frozen=True, kw_only=True)
class TeleopLimits:
    """Greatest commands and their greatest changes.

    Attributes:
        speed: m/s over ground.
        climb: m/s.
        turn: degrees/s.
        change_s: time from zero to the greatest command, s.
    """

    speed: float = 2.0
    climb: float = 1.0
    turn: float = 45.0
    change_s: float = 0.7

    def __post_init__(self) -> None:
        for name in ("speed", "climb", "turn", "change_s"):
            if not getattr(self, name) > 0.0:
                raise UsageError(f"teleoperation: {name}={getattr(self, name)}; give a value above 0")


class Input(Protocol):
    """Where the operator's input comes from."""

    def poll(self) -> Intent | str | None:
        """Return the newest input since the last call, ``LAND``, ``QUIT``, or ``None`` if there is none.

        Raises:
            VehicleError: the device is gone.
        """


class Teleoperator:
    """Turns inputs into limited commands; a pure state machine over time.

    Args:
        limits: limits of the commands.
    """

    def __init__(self, limits: TeleopLimits) -> None:
        self._limits = limits
        self._intent = NOTHING
        self._at: Ns | None = None
        self._shares = NOTHING
        self._last: Ns | None = None

    def receive(self, intent: Intent, now: Ns) -> None:
        """Take the newest input."""
        self._intent, self._at = intent, now

    def command(self, now: Ns, heading: float) -> MotionCommand:
        """Return the command at *now* ns for a drone with *heading* in degrees."""
        held = self._at is not None and now - self._at <= DEAD_MAN
        wanted = self._intent if held else NOTHING
        passed = to_seconds(now - self._last) if self._last is not None else 0.0
        self._last = now
        most = passed / self._limits.change_s
        self._shares = Intent(
            *(
                have + min(most, max(-most, min(1.0, max(-1.0, aim)) - have))
                for have, aim in zip(self._shares, wanted, strict=True)
            )
        )
        limits, (forward, right, up, turn) = self._limits, self._shares
        c, s = cos(radians(heading)), sin(radians(heading))
        north, east = forward * c - right * s, forward * s + right * c
        return MotionCommand(north * limits.speed, east * limits.speed, up * limits.climb, turn * limits.turn)


class Keyboard:
    """Keys of a terminal, without Enter; a key that is held repeats.

    Args:
        file: descriptor of the terminal.
    """

    def __init__(self, file: int) -> None:
        self._file = file

    def poll(self) -> Intent | str | None:
        """Return the meaning of the newest key; other keys are ignored."""
        newest: Intent | str | None = None
        while select.select([self._file], [], [], 0.0)[0]:
            try:
                data = os.read(self._file, 64)
            except OSError:  # the terminal was closed
                data = b""
            if not data:
                return QUIT
            for letter in data.decode(errors="ignore").lower():
                meaning = KEYS.get(letter)
                if isinstance(meaning, str):
                    return meaning
                newest = meaning if meaning is not None else newest
        return newest


@contextmanager
def keyboard() -> Iterator[Keyboard]:
    """Yield the keys of the terminal of this process; its settings are restored.

    Raises:
        UsageError: standard input is no terminal.
    """
    file = sys.stdin.fileno()
    if not os.isatty(file):
        raise UsageError("standard input is no terminal; give --joystick DEVICE, or start it in a terminal")
    before = termios.tcgetattr(file)
    tty.setcbreak(file)
    try:
        yield Keyboard(file)
    finally:
        with suppress(termios.error):  # the terminal was closed
            termios.tcsetattr(file, termios.TCSADRAIN, before)


_EVENT = struct.Struct("<IhBB")
"""Event of Linux's joystick interface: time ms, value, kind, number (linux/joystick.h)."""
_BUTTON, _AXIS = 1, 2
_FULL = 32767.0
DEAD_ZONE = 0.08
DEAD_MAN_BUTTON, LAND_BUTTON = 4, 1
SILENT_POLLS = 30
"""Polls without a report after which sticks and button count for nothing: 3 s. A hand moves by then."""


class Joystick:
    """A joystick of Linux (``/dev/input/js0``) in mode 2: left stick climbs and turns, right stick moves.

    The dead-man button (the left shoulder button) must be held, and sticks that are deflected must report
    something each three seconds: to push one to its end and hold it there stops the drone. Button 1 lands.

    Args:
        path: the device.

    Raises:
        UsageError: there is no such device.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise UsageError(f"cannot open the joystick {path}: {error.strerror or error}") from error
        self._path = path
        self._axes: dict[int, float] = {}
        self._held = False
        self._silent = 0

    def poll(self) -> Intent | str | None:
        """Return the position of the sticks while the dead-man button is held."""
        self._silent += 1
        while True:
            try:
                data = os.read(self._file, _EVENT.size)
            except BlockingIOError:
                break
            except OSError as error:
                raise VehicleError("teleoperation", f"the joystick {self._path}", str(error)) from error
            if len(data) < _EVENT.size:
                raise VehicleError("teleoperation", f"the joystick {self._path}", "it was unplugged")
            self._silent = 0
            _, value, kind, number = _EVENT.unpack(data)
            if kind & _AXIS:
                self._axes[number] = value / _FULL
            elif kind & _BUTTON:
                if number == LAND_BUTTON and value and not kind & 0x80:
                    return LAND
                if number == DEAD_MAN_BUTTON:
                    self._held = bool(value)
        if not self._held or self._silent >= SILENT_POLLS:
            return None
        turn, up, right, forward = (self._axis(number) for number in (0, 1, 3, 4))
        return Intent(-forward, right, -up, turn)

    def _axis(self, number: int) -> float:
        value = max(-1.0, min(1.0, self._axes.get(number, 0.0)))
        return 0.0 if abs(value) < DEAD_ZONE else value

    def close(self) -> None:
        """Close the device."""
        os.close(self._file)


def describe_flight(seen: Telemetry) -> str:
    """Return mode, height, speed, battery and distance from home in one line, as last reported."""
    away = nan
    if seen.position is not None and seen.home is not None:
        frame = LocalFrame(seen.home.latitude, seen.home.longitude, 0.0)
        away = hypot(*frame.to_enu(seen.position.latitude, seen.position.longitude, 0.0)[:2])
    figures = (
        f"{seen.above_home:z.1f} m above home",
        f"{hypot(*seen.velocity):.1f} m/s",
        f"battery {seen.battery.remaining:.0%}",
        f"{away:.0f} m from home",
    )
    known = (figure.replace("nan%", "unknown").replace("nan", "?") for figure in figures)
    return " · ".join((seen.mode or "no mode", *known, *(("STALE",) if seen.stale else ())))


def teleoperate(
    drone: Drone,
    source: Input,
    actuation: Actuation,
    limits: TeleopLimits,
    height: float,
    show: Callable[[str], None] = lambda _: None,
) -> str:
    """Fly by the operator's input until it lands, quits or is lost; return what ended it.

    A device that is lost makes the drone stop and hover; then it lands.

    Args:
        drone: the drone.
        source: keyboard or joystick.
        actuation: how commands are applied.
        limits: limits of the commands.
        height: height of the take-off, m above home.
        show: called with ``describe_flight`` twice a second; it must not block.
    """
    kernel = drone.kernel
    drone.wait_ready()
    seen = drone.telemetry
    showing = kernel.every(SHOWN, lambda: show(describe_flight(seen)))
    try:
        return _fly_by_hand(drone, source, actuation, limits, height)
    finally:
        showing.cancel()


def _fly_by_hand(
    drone: Drone, source: Input, actuation: Actuation, limits: TeleopLimits, height: float
) -> str:
    kernel = drone.kernel
    if drone.flying:
        actuation.engage()
    else:
        actuation.take_off(height)
    operator = Teleoperator(limits)
    rate = Rate(kernel, PERIOD)
    lost = ""
    until: Ns | None = None
    while True:
        rate.sleep()
        now = kernel.now()
        if not lost:
            try:
                meaning = source.poll()
            except VehicleError as error:
                lost, until = str(error), now + from_seconds(limits.change_s + 1.0)
                meaning = None
            if isinstance(meaning, str):
                if meaning == LAND:
                    drone.land()
                return meaning
            if meaning is not None:
                operator.receive(meaning, now)
        elif until is not None and now >= until:
            drone.land()
            return lost
        seen = drone.telemetry
        measured = MeasuredState(seen.attitude.heading, 0.0, 0.0, seen.above_home, *seen.velocity)
        command = operator.command(now, seen.attitude.heading)
        actuation.apply(command, measured, to_seconds(PERIOD))
