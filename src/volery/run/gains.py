"""Gains that change while a vehicle flies: a TOML file that is read again, and parameters of a ROS node.

Both state gains by loop. Wrong ones change nothing and are noted in the record, since a law must not lose its
gains in the air; only those that are wrong before the flight are an error.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import Ns, S, from_seconds
from volery.control.laws import PidGains, PidLaw
from volery.control.manoeuvres import LawManoeuvre, set_gains
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep
from volery.ros.graph import Node
from volery.trace.events import NOTICE, Text
from volery.vehicles import Drone

READ_AGAIN: Ns = S
"""Time after which gains are read again."""
AS_PARAMETERS = ("kp", "ki", "kd", "filter_s", "slew", "deceleration")
"""Gains that are parameters of the node, those of them that are finite."""


def loops_of(manoeuvre: LawManoeuvre) -> dict[str, PidGains]:
    """Return the present gains of the PID laws by loop."""
    return {name: law.gains for name, law in manoeuvre.laws.items() if isinstance(law, PidLaw)}


def read_gains(path: Path, loops: Mapping[str, PidGains]) -> dict[str, PidGains]:
    """Return the gains in a TOML file: a table for each loop, with the fields of ``PidGains``.

    Args:
        path: the file.
        loops: present gains by loop; fields that the file does not state keep these values.

    Raises:
        UsageError: the file cannot be read, or states a loop, a field or a value that is none.
    """
    try:
        stated: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read gains from {path}: {error}") from error
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise UsageError(f"{path} is no TOML: {error}") from error
    return check_gains(stated, loops, str(path))


def check_gains(stated: Mapping[str, Any], loops: Mapping[str, PidGains], source: str) -> dict[str, PidGains]:
    """Return stated gains by loop, with the present ones where a field is not stated.

    Args:
        stated: fields and values by loop.
        loops: present gains by loop.
        source: where they were stated, for messages.

    Raises:
        UsageError: a loop, a field or a value is none.
    """
    known = {field.name for field in fields(PidGains)}
    found: dict[str, PidGains] = {}
    for loop, table in stated.items():
        if loop not in loops:
            hint = did_you_mean(loop, tuple(loops))
            raise UsageError(f"{source}: no loop {loop!r}{hint}; there is {choices(tuple(loops))}")
        if not isinstance(table, dict):
            raise UsageError(f"{source}: {loop} is {table!r}; write a table, such as [{loop}] and kp = 2.0")
        values = {field.name: getattr(loops[loop], field.name) for field in fields(PidGains)}
        for name, value in table.items():
            if name not in known or not isinstance(value, bool | int | float):
                hint = did_you_mean(name, tuple(known))
                raise UsageError(f"{source}: [{loop}] {name} = {value!r} is no gain{hint}")
            values[name] = value
        try:
            found[loop] = PidGains(**values)
        except UsageError as error:
            raise UsageError(f"{source}: [{loop}]: {error}") from error
    return found


def _change(
    manoeuvre: LawManoeuvre, drone: Drone, read: Callable[[], dict[str, PidGains]], source: str
) -> None:
    """Use the gains that *read* returns; if they are wrong, the gains remain, and the record states why."""
    try:
        for loop, gains in read().items():
            set_gains(manoeuvre, loop, gains)
        said = f"gains of {source} are in use"
    except UsageError as error:
        said = f"the gains remain as they were: {error}"
    drone.kernel.record(Text(drone.kernel.now(), f"{drone.name} control", NOTICE, said))


class GainsFile:
    """A file of gains, read when it is made and again while the vehicle flies.

    Args:
        path: the file.
        manoeuvre: its laws get the gains.

    Raises:
        UsageError: the file is wrong.
    """

    def __init__(self, path: Path, manoeuvre: LawManoeuvre) -> None:
        self._path, self._manoeuvre = path, manoeuvre
        self._loops = loops_of(manoeuvre)
        self._text = path.read_bytes() if path.is_file() else b""
        found = read_gains(path, self._loops)
        for loop, gains in found.items():
            set_gains(manoeuvre, loop, gains)
        self.stated = frozenset(found)
        """Loops that the file states."""
        self._due: Ns = 0

    def watch(self, drone: Drone) -> Callable[[float], None]:
        """Return what reads the file again each second; it is called with the elapsed time in s."""

        def look(elapsed: float) -> None:
            now = from_seconds(elapsed)
            if now < self._due:
                return
            self._due = now + READ_AGAIN
            text = self._path.read_bytes() if self._path.is_file() else self._text
            if text == self._text:
                return
            self._text = text
            _change(self._manoeuvre, drone, lambda: read_gains(self._path, self._loops), self._path.name)

        return look


class GainParameters:
    """Gains as private parameters of a ROS node, such as ``~yaw/kp``, read again in a task of its own.

    A task of its own reads them, since the parameters of ROS 1 are those of another process.

    Args:
        node: node on any graph. Parameters that are set before replace the manoeuvre's gains.
        manoeuvre: its laws get the gains.

    Raises:
        UsageError: parameters that were set before are no gains.
    """

    def __init__(self, node: Node, manoeuvre: LawManoeuvre) -> None:
        self._node, self._manoeuvre = node, manoeuvre
        self._loops = loops_of(manoeuvre)
        self._open = True
        for loop, gains in self._loops.items():
            for name in AS_PARAMETERS:
                usual = float(getattr(gains, name))
                if isfinite(usual):
                    parameter = f"~{loop}/{name}"
                    node.set_parameter(parameter, node.get_parameter(parameter, usual))
        self._last = self._parameters()
        changed = {loop: found for loop, found in self._read().items() if found != self._loops[loop]}
        for loop, found in changed.items():
            set_gains(manoeuvre, loop, found)
        self.stated = frozenset(changed)
        """Loops whose parameters were set before."""

    def _parameters(self) -> dict[str, dict[str, Any]]:
        """Return the parameters by loop; a parameter that was deleted keeps its first value."""
        return {
            loop: {
                name: self._node.get_parameter(f"~{loop}/{name}", usual)
                for name in AS_PARAMETERS
                if isfinite(usual := float(getattr(gains, name)))
            }
            for loop, gains in self._loops.items()
        }

    def _read(self, loops: Collection[str] | None = None) -> dict[str, PidGains]:
        stated = {loop: one for loop, one in self._last.items() if loops is None or loop in loops}
        return check_gains(stated, self._loops, f"parameters of {self._node.name}")

    def watch(self, drone: Drone) -> None:
        """Start the task that reads the parameters each second."""
        name = f"gains of {drone.name}"
        drone.kernel.spawn(lambda: self._follow(drone), name, ExecutionContext(name))

    def _follow(self, drone: Drone) -> None:
        while self._open:
            stated, before = self._parameters(), self._last
            if stated != before:
                self._last = stated
                loops = [loop for loop, one in stated.items() if one != before[loop]]
                _change(self._manoeuvre, drone, partial(self._read, loops), self._node.name)
            sleep(drone.kernel, READ_AGAIN)

    def close(self) -> None:
        """End the task at its next look."""
        self._open = False
