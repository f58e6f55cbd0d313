"""Parameters of a simulated autopilot, and the figures that manoeuvres fly by.

Values are stored as the wire carries them: a ``float`` rounded to the parameter's own type (an integer type
rounds, a real type is single precision). Each firmware derives its ``ManoeuvreTuning`` from its parameters.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from math import isfinite, radians
from typing import NamedTuple

from volery.base.errors import UsageError, did_you_mean
from volery.base.time import Ns, S
from volery.simulation.autopilots.manual_control import StickMap

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
"""MAV_PARAM_TYPE of the types that the recorded firmwares use."""

_BOUNDS = {INT8: (-128, 127), INT16: (-32_768, 32_767), INT32: (-2_147_483_648, 2_147_483_647)}
_SINGLE = struct.Struct("<f")


def single(value: float) -> float:
    """Return the nearest single-precision number, as a ``float`` field of a message carries it."""
    rounded: float = _SINGLE.unpack(_SINGLE.pack(value))[0]
    return rounded


class StoredParameter(NamedTuple):
    """One parameter: ``type`` is a MAV_PARAM_TYPE, ``value`` a number of that type."""

    name: str
    type: int
    value: float
    listed_by: str = ""
    """The parameter that must not be 0 for this one to be listed; empty: it is always listed."""


def _same(value: float) -> float:
    return value


class Renamed(NamedTuple):
    """A parameter that a version of a firmware shows by another name, and perhaps as another number."""

    name: str
    type: int | None
    """MAV_PARAM_TYPE; ``None``: that of the firmware's own table."""
    shown: Callable[[float], float] = _same
    """Return the value as it is shown."""
    own: Callable[[float], float] = _same
    """Return the value that the firmware's own table has."""


NOT_RENAMED: Mapping[str, Renamed] = {}


def quantised(kind: int, value: float) -> float:
    """Return *value* as a parameter of type *kind* stores it; integers are limited to their range."""
    if kind not in _BOUNDS:
        return single(value)
    low, high = _BOUNDS[kind]
    return float(min(high, max(low, round(value))))


def load(package: str, resource: str) -> tuple[StoredParameter, ...]:
    """Read a packaged list: ``name type value [listed_by]`` per line, ``#`` starts a comment."""
    found = []
    for line in files(package).joinpath(resource).read_text(encoding="ascii").splitlines():
        if line and not line.startswith("#"):
            name, kind, value, *listed_by = line.split()
            found.append(StoredParameter(name, int(kind), quantised(int(kind), float(value)), *listed_by))
    return tuple(found)


class VehicleParameters:
    """Parameters of one vehicle in the order of their indices.

    Those of a subsystem that is switched off are read and set by name, but have no index: length, iteration
    and indices count the listed ones only.

    All names and values here are those that are shown, but for the value of ``[]`` and ``in``, which take the
    name and give the value of the firmware's own table: what a parameter does is stated for one version only.

    Args:
        defaults: All parameters with their default values, by the firmware's own names.
        of_vehicle: Values of this vehicle that replace defaults.
        overrides: Values that a user gives.
        renamed: Parameters that the version shows otherwise, by the firmware's own names.
        supported: Parameters that change the behaviour, by the firmware's own names; ``None``: all do.
        remedy: Returns what to do to have a parameter that is not there; empty: nothing.

    Raises:
        UsageError: A name in *overrides* does not exist, its value is not finite or not of the parameter's
            type, or a change of it has no effect.
    """

    def __init__(
        self,
        defaults: Iterable[StoredParameter],
        overrides: Mapping[str, float] | None = None,
        renamed: Mapping[str, Renamed] = NOT_RENAMED,
        *,
        of_vehicle: Mapping[str, float] | None = None,
        supported: Collection[str] | None = None,
        remedy: Callable[[str], str] = lambda _name: "",
    ) -> None:
        own = tuple(defaults)
        self._values = {parameter.name: parameter.value for parameter in own}
        self._renamed = renamed
        self._own = {one.name: name for name, one in renamed.items() if name in self._values}
        self._order = tuple(self._shown(parameter) for parameter in own)
        self._index = {parameter.name: index for index, parameter in enumerate(self._order)}
        self._shown_values = {name: self._order[self._index[name]].value for name in self._own}
        """Values as they are shown, where that is not what ``[]`` gives."""
        self._gates = {parameter.listed_by for parameter in own}
        self._listed: tuple[str, ...] = ()
        self._places: dict[str, int] = {}
        self._list()
        self.changes = 0
        """Number of values that were set so far."""
        shown = self._index if supported is None else (self.name(one) for one in supported)
        self._effective = frozenset(shown)
        for name, value in (of_vehicle or {}).items():
            self.set(self.name(name), value)
        for name, value in (overrides or {}).items():
            self._override(name, value, remedy)

    def _override(self, name: str, value: float, remedy: Callable[[str], str]) -> None:
        """Set a parameter as a user states it."""
        if name not in self._index:
            now = self._renamed.get(name)
            hint = f"; {remedy(name)}" if remedy(name) else did_you_mean(name, self._index)
            hint = hint if now is None else f"; it is {now.name} now"
            raise UsageError(f"the autopilot has no parameter {name!r}{hint}")
        before, kind = self._now(name), self._order[self._index[name]].type
        after = self.set(name, value)
        if after is None:
            raise UsageError(f"parameter {name} cannot be {value}: it takes finite numbers")
        if kind in _BOUNDS and after.value != value:
            low, high = _BOUNDS[kind]
            raise UsageError(f"parameter {name} cannot be {value:g}: it is an integer from {low} to {high}")
        if after.value != before.value and not self.has_effect(name):
            raise UsageError(
                f"parameter {name} has no effect in the simulation, which would fly as with"
                f" {before.value:g}; leave it out"
            )

    def has_effect(self, name: str) -> bool:
        """Return whether a change of the parameter of that name changes what the vehicle does."""
        return name in self._effective

    def _shown(self, parameter: StoredParameter) -> StoredParameter:
        """Return a parameter of the firmware's own table as it is shown."""
        one = self._renamed.get(parameter.name)
        if one is None:
            return parameter
        kind = parameter.type if one.type is None else one.type
        return StoredParameter(
            one.name, kind, quantised(kind, one.shown(parameter.value)), parameter.listed_by
        )

    def name(self, own: str) -> str:
        """Return the name that is shown of a parameter of the firmware's own table."""
        one = self._renamed.get(own)
        return own if one is None else one.name

    def _list(self) -> None:
        """List the parameters whose subsystems are switched on."""
        self._listed = tuple(
            one.name for one in self._order if not one.listed_by or self._values[one.listed_by]
        )
        self._places = {name: index for index, name in enumerate(self._listed)}

    def __len__(self) -> int:
        return len(self._listed)

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __iter__(self) -> Iterator[StoredParameter]:
        return (self.at(index) for index in range(len(self._listed)))

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def at(self, index: int) -> StoredParameter:
        """Return the parameter with that index."""
        return self._now(self._listed[index])

    def index(self, name: str) -> int:
        """Return the index of a parameter that is listed."""
        return self._places[name]

    def find(self, name: str) -> StoredParameter | None:
        """Return the parameter of that name, listed or not, or ``None``."""
        return self._now(name) if name in self._index else None

    def _now(self, name: str) -> StoredParameter:
        parameter = self._order[self._index[name]]
        value = self._shown_values[name] if name in self._own else self._values[name]
        return parameter if parameter.value == value else parameter._replace(value=value)

    def reset(self) -> None:
        """Set all parameters to their defaults."""
        for one in self._order:
            self.set(one.name, one.value)

    def set(self, name: str, value: float) -> StoredParameter | None:
        """Set a parameter and return it, rounded to its type.

        Returns:
            ``None`` if there is no such parameter or *value* is not finite.
        """
        index = self._index.get(name)
        if index is None or not isfinite(value):
            return None
        kept = quantised(self._order[index].type, value)
        own = self._own.get(name, name)
        if own is not name:
            self._shown_values[name] = kept
            kept = self._renamed[own].own(kept)
        self._values[own] = kept
        self.changes += 1
        if own in self._gates:
            self._list()
        return self._now(name)


@dataclass(frozen=True)
class ManoeuvreTuning:
    """Limits and gains of manoeuvres: speeds m/s, accelerations m/s^2, angles rad, lengths m, times ns."""

    sticks: StickMap = field(default_factory=StickMap)
    speed: float = 10.0
    speed_up: float = 2.5
    speed_down: float = 1.5
    accel: float = 2.5
    accel_z: float = 1.0
    tilt: float = radians(30.0)
    waypoint_radius: float = 2.0
    face_path: bool = True
    """Whether the nose points along the path of a mission."""
    face_return: bool = False
    """Whether the nose points along the path of a return."""
    straight: bool = False
    """Whether a point at another height is approached along a straight line."""

    yaw_loop: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Gain, integral gain and filter in rad/s of the yaw rate loop, see ``Flight.set_yaw_loop``."""

    brakes: bool = True
    """Whether a rover brakes by its motor."""

    land_speed: float = 0.5
    land_speed_high: float = 1.5
    land_slow_below: float = 10.0

    return_height: float = 15.0
    return_climb_min: float = 0.0
    return_cone: float = 3.0
    return_speed: float = 10.0
    return_wait: Ns = 5 * S
    return_final: float = 0.0
    """Height above home at which a return ends; 0: it lands."""

    pilot_speed: float = 2.0
    pilot_up: float = 2.5
    pilot_down: float = 2.5
    pilot_accel_z: float = 2.5
    pilot_yaw_rate: float = radians(202.5)
    pilot_takeoff: float = 0.0
    """Height [m] to which a climb from the ground by the throttle goes on by itself; 0: it does not."""
    throttle_dead: float = 0.1
    """Half width of the throttle's dead zone about its middle, on a scale of 0..1."""
    hover_throttle: float | None = None
    """Stored collective in hover, see ``Flight.set_hover_throttle``; ``None``: that of the inner loops."""
    gps_gate: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Gate of a fix in sigmas, its least sigma and the radius of a reset [m], see ``Flight.set_gps_gate``."""
    thrust_volts: tuple[float, float] = (0.0, 0.0)
    """Voltage for which thrust is computed, and the least that counts, see ``Flight.set_thrust_voltage``."""
    learns_hover: bool = True
    """Whether they adapt it in flight."""

    loiter_speed: float = 12.5
    loiter_accel: float = 5.0
    loiter_tilt: float = radians(20.0)
    loiter_brake: float = 2.5
    loiter_brake_delay: Ns = S

    circle_radius: float = 10.0
    circle_rate: float = radians(20.0)

    target_timeout: Ns = 3 * S
