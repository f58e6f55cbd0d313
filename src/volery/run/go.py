"""``go``: a flight under a control law on this side of the link, on any vehicle.

It makes a mission of a manoeuvre, the way its commands are applied and the safety switch, and ``fly`` flies
it. Gains can be read from a file, which is read again while the vehicle flies.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import Ns, from_seconds
from volery.control.actuation import Actuation, AttitudeSetpoints, RcOverride, VelocitySetpoints
from volery.control.flight import PERIOD, ControlledFlight
from volery.control.laws import PidGains, PidLaw
from volery.control.manoeuvres import Manoeuvre, set_gains
from volery.control.safety_switch import SwitchSettings
from volery.run.fly import fly
from volery.run.result import Options, Run
from volery.trace.events import Event, Stream, Text
from volery.vehicles import Drone
from volery.vehicles.address import MAVLINK_OPTIONS, parse
from volery.vehicles.driver import drivers

ACTUATIONS: Mapping[str, Callable[[Drone], Actuation]] = {
    "setpoints": VelocitySetpoints,
    "attitude": AttitudeSetpoints,
    "rc": RcOverride,
}
WAYS = tuple(ACTUATIONS)
RATES = {"rate": "20", "attitude": "50", "rc": "20"}
"""Telemetry that a control loop needs, Hz, unless the address states other rates."""
READ_AGAIN_S = 1.0
"""Time after which a file of gains is read again."""


@dataclass(frozen=True, kw_only=True)
class GoSettings:
    """How a manoeuvre is flown.

    Attributes:
        by: one of ``WAYS``.
        switch: the operator's switch, or ``None`` to fly without.
        height: height of the take-off, m above home.
        gains: file with gains by loop, or ``None``.
        period: sample time, ns.
    """

    by: str = "setpoints"
    switch: SwitchSettings | None = None
    height: float = 5.0
    gains: Path | None = None
    period: Ns = PERIOD

    def __post_init__(self) -> None:
        if self.by not in WAYS:
            raise UsageError(f"by {self.by!r}{did_you_mean(self.by, WAYS)}; there is {choices(WAYS)}")
        if not self.height > 0.0:
            raise UsageError(f"a take-off to {self.height:g} m; give a height above 0")


def with_rates(url: str, switch: SwitchSettings | None) -> str:
    """Return the address with the telemetry rates that a control loop needs, where they can be requested.

    A simulated pilot's transmitter has its switch in the middle, unless the address states otherwise.
    """
    address = parse(url)
    factory = drivers.load(address.driver)
    if (
        factory.on_link is None
        or factory.codec.name != "MAVLink"
        or address.transport in {"ros1", "ros2", "graph"}
    ):
        return url
    added = {name: value for name, value in RATES.items() if name in MAVLINK_OPTIONS}
    if switch is None:
        del added["rc"]
    elif address.transport == "sim":
        added["transmitter"] = f"{switch.channel}:{(switch.manual_below + switch.landing_above) // 2}"
    missing = [f"{name}={value}" for name, value in added.items() if name not in address.options]
    return f"{url}{'&' if '?' in url else '?'}{'&'.join(missing)}" if missing else url


def go(
    make: Callable[[], Manoeuvre],
    on: str,
    settings: GoSettings,
    options: Options,
    *,
    listener: Callable[[Event], None] | None = None,
) -> Run:
    """Fly a manoeuvre and return the record.

    Args:
        make: makes the manoeuvre.
        on: address of the vehicle.
        settings: how it is flown.
        options: options of the run.
        listener: called with each event of the run while the mission lasts.

    Raises:
        UsageError: the address, the gains or the settings are wrong; nothing has started.
    """
    manoeuvre = make()
    gains = _GainsFile(settings.gains, manoeuvre) if settings.gains is not None else None

    def mission(drone: Drone) -> None:
        actuation = ACTUATIONS[settings.by](drone)
        flight = ControlledFlight(
            drone,
            manoeuvre,
            actuation,
            switch=settings.switch,
            period=settings.period,
            height=settings.height,
            on_sample=gains.watch(drone) if gains is not None else lambda _: None,
        )
        stream = drone.kernel.record
        if listener is not None and isinstance(stream, Stream):
            stream.tap(listener)
        drone.wait_ready()
        flight.run()

    return fly(mission, with_rates(on, settings.switch), options)


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
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} is no TOML: {error}") from error
    known = {one.name for one in fields(PidGains)}
    found: dict[str, PidGains] = {}
    for loop, table in stated.items():
        if loop not in loops:
            hint = did_you_mean(loop, tuple(loops))
            raise UsageError(f"{path}: no loop {loop!r}{hint}; there is {choices(tuple(loops))}")
        if not isinstance(table, dict):
            raise UsageError(f"{path}: {loop} is {table!r}; write a table, such as [{loop}] and kp = 2.0")
        values = {one.name: getattr(loops[loop], one.name) for one in fields(PidGains)}
        for name, value in table.items():
            if name not in known or not isinstance(value, bool | int | float):
                hint = did_you_mean(name, tuple(known))
                raise UsageError(f"{path}: [{loop}] {name} = {value!r} is no gain{hint}")
            values[name] = value
        try:
            found[loop] = PidGains(**values)
        except UsageError as error:
            raise UsageError(f"{path}: [{loop}]: {error}") from error
    return found


class _GainsFile:
    """A file of gains that is read again while the vehicle flies; a wrong one changes nothing."""

    def __init__(self, path: Path, manoeuvre: Manoeuvre) -> None:
        self._path, self._manoeuvre = path, manoeuvre
        self._loops = {name: law.gains for name, law in manoeuvre.laws.items() if isinstance(law, PidLaw)}
        self._text = path.read_bytes() if path.is_file() else b""
        self._apply()
        self._due: Ns = 0

    def _apply(self) -> None:
        for loop, gains in read_gains(self._path, self._loops).items():
            set_gains(self._manoeuvre, loop, gains)

    def watch(self, drone: Drone) -> Callable[[float], None]:
        """Return what reads the file again each second."""

        def look(elapsed: float) -> None:
            now = from_seconds(elapsed)
            if now < self._due:
                return
            self._due = now + from_seconds(READ_AGAIN_S)
            text = self._path.read_bytes() if self._path.is_file() else self._text
            if text == self._text:
                return
            self._text = text
            try:
                self._apply()
                said = f"gains of {self._path.name} are in use"
            except UsageError as error:
                said = f"the gains remain as they were: {error}"
            drone.kernel.record(Text(drone.kernel.now(), f"{drone.name} control", 5, said))

        return look
