"""A body that an FMU moves: the values that it is given and gives, and their axes.

The FMU's world is the body's start: its axes are those of the body there, level, and the origin is on the
ground. So an FMU needs to know neither the place nor the heading of a vehicle. An FMU that begins elsewhere,
or with another yaw, is moved and turned to the start; its height above the ground is its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite, nan, sqrt

from volery.base.frames import (
    Quaternion,
    Vector,
    attitude_frd_to_flu,
    body_to_world,
    euler_to_quaternion,
    flu_to_frd,
    multiply,
    world_to_body,
)
from volery.base.time import to_seconds
from volery.simulation.fmu.running_fmu import RunningFmu
from volery.simulation.real_firmware.firmware_process import FirmwareError
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.dynamics import CELL_FULL_VOLTS
from volery.simulation.world.state_layout import (
    P_MASS,
    ROTORS,
    S_ATTITUDE,
    S_COLLISIONS,
    S_GROUND,
    S_GUST,
    S_POSITION,
    S_VOLTS,
    U_MOTOR_HEALTH,
    U_PUSH,
    U_WIND,
    W_THROTTLE,
    WORLD,
    Array,
)
from volery.simulation.world.world import STEP

_SAG = 0.005  # [m] by which a body stands in the ground at the start
_LEVEL = 0.01  # sine of half the tilt with which an FMU may begin
_DEEPEST = 1.0  # [m] below the ground: it falls for ever
_UNIT = (0.9, 1.1)  # length of a quaternion


class FmuBody:
    """What moves a body by an FMU; a ``MotionSource``.

    Args:
        fmu: The FMU, just started.
        spec: The body without it.
        axes: Axes of the FMU: ``flu`` or ``frd``.

    Raises:
        FirmwareError: It does not start, or begins tilted or below its ground.
    """

    def __init__(self, fmu: RunningFmu, spec: Multirotor, axes: str) -> None:
        self.fmu, self._down = fmu, axes == "frd"
        self._rotors, self._own_mass = len(spec.rotors), spec.mass
        readers = {
            "commands": self._commands,
            "wind": self._wind,
            "ground": self._ground,
            "voltage": self._voltage,
            "load": self._load,
            "push": self._push,
        }
        self._readers = [readers[name] for name in fmu.interface.inputs.widths]
        self._columns: dict[str, slice] = {}
        end = 0
        for name, width in fmu.interface.outputs.widths.items():
            self._columns[name] = slice(end, end + width)
            end += width
        self._turn: Quaternion = (1.0, 0.0, 0.0, 0.0)  # from the FMU's world to the world
        self._origin: Vector = (0.0, 0.0, 0.0)  # of the FMU's world
        before = [0.0] * WORLD
        before[S_VOLTS] = spec.battery.cells * CELL_FULL_VOLTS
        before[P_MASS] = spec.mass + spec.payload
        self._start = self._exchange(before)
        height = self._vector("position", self._start)[2]
        _, x, y, _ = self._attitude(self._start)
        if height <= -_SAG or max(abs(x), abs(y)) > _LEVEL:
            raise fmu.process.error(
                f"begins {height:g} m above the ground, tilted by {2.0 * max(abs(x), abs(y)):.2g} rad; let it"
                " begin level, with the origin of its world on the ground"
            )
        self.spec = replace(spec, feet=(*spec.feet[:2], height + _SAG))
        """The body, on feet as long as the FMU begins above its ground."""

    def begin(self, row: Sequence[float]) -> None:
        """Take the place and the heading of the body at the start from its state row."""
        w, _, _, z = self._attitude(self._start)
        turned = multiply((row[S_ATTITUDE], 0.0, 0.0, row[S_ATTITUDE + 3]), (w, 0.0, 0.0, -z))
        length = sqrt(turned[0] * turned[0] + turned[3] * turned[3])
        self._turn = turned[0] / length, 0.0, 0.0, turned[3] / length
        forward, left, _ = self._vector("position", self._start)
        east, north, _ = body_to_world(self._turn, (forward, left, 0.0))
        self._origin = row[S_POSITION] - east, row[S_POSITION + 1] - north, row[S_GROUND]

    def advance(self, step: int, row: Array) -> Sequence[float]:
        """See ``MotionSource``.

        Raises:
            FirmwareError: The FMU has ended or hangs, a value is not finite, its attitude is none, or it has
                fallen through the ground. The text has the last good state.
        """
        before: list[float] = row[:WORLD].tolist()
        try:
            values = self._exchange(before)
            self._check(values, before)
        except FirmwareError as error:
            raise FirmwareError(f"{error}; {self._last_state(step - 1, before)}") from None
        position = body_to_world(self._turn, self._vector("position", values))
        return (
            *(position[axis] + self._origin[axis] for axis in range(3)),
            *body_to_world(self._turn, self._vector("velocity", values)),
            *multiply(self._turn, self._attitude(values)),
            *self._vector("rates", values),
            *self._optional("rotor_speeds", ROTORS, values),
            *(self._vector("specific_force", values) if "specific_force" in self._columns else (nan,) * 3),
            *self._optional("current", 1, values),
        )

    # -- what it gives

    def _exchange(self, row: Sequence[float]) -> tuple[float, ...]:
        return self.fmu.exchange([value for reader in self._readers for value in reader(row)])

    def _vector(self, name: str, values: Sequence[float]) -> Vector:
        """Return three values in forward, left, up."""
        first, second, third = values[self._columns[name]]
        return flu_to_frd((first, second, third)) if self._down else (first, second, third)

    def _attitude(self, values: Sequence[float]) -> Quaternion:
        """Return the attitude of the body in its world, both forward, left, up."""
        if "attitude" in self._columns:
            w, x, y, z = values[self._columns["attitude"]]
        else:
            w, x, y, z = euler_to_quaternion(*values[self._columns["angles"]])
        return attitude_frd_to_flu((w, x, y, z)) if self._down else (w, x, y, z)

    def _optional(self, name: str, width: int, values: Sequence[float]) -> tuple[float, ...]:
        given = values[self._columns[name]] if name in self._columns else ()
        return (*given, *((nan,) * (width - len(given))))

    def _check(self, values: Sequence[float], row: Sequence[float]) -> None:
        if not all(map(isfinite, values)):
            wrong = [name for name, at in self._columns.items() if not all(map(isfinite, values[at]))]
            raise self.fmu.process.error(f"gives no finite number for {', '.join(wrong)}")
        length = sqrt(sum(part * part for part in self._attitude(values)))
        if not _UNIT[0] < length < _UNIT[1]:
            raise self.fmu.process.error(f"gives an attitude of the length {length:.3g}; a quaternion has 1")
        deep = row[S_GROUND] - self._origin[2] - self._vector("position", values)[2]
        if deep > _DEEPEST:
            raise self.fmu.process.error(
                f"falls through the ground: give it a contact with the ground, whose height is its input "
                f"`ground`{'' if 'ground' in self.fmu.interface.inputs.widths else ', which it lacks'}"
            )

    def _last_state(self, step: int, row: Sequence[float]) -> str:
        east, north, up = row[S_POSITION : S_POSITION + 3]
        speeds = ", ".join(f"{speed:.3g}" for speed in row[S_POSITION + 3 : S_POSITION + 6])
        return (
            f"its last good state, at {to_seconds(step * STEP):.3f} s: {east:.2f} m east, "
            f"{north:.2f} m north, {up:.2f} m up of the origin, at {speeds} m/s"
        )

    # -- what it is given

    def _given(self, v: Vector) -> Vector:
        return flu_to_frd(v) if self._down else v

    def _commands(self, row: Sequence[float]) -> Sequence[float]:
        """Return the commands; of a weak motor the share that has its share of the thrust."""
        if row[S_COLLISIONS] > 0.0:  # its blades are broken
            return (0.0,) * self._rotors
        return [row[W_THROTTLE + motor] * sqrt(row[U_MOTOR_HEALTH + motor]) for motor in range(self._rotors)]

    def _wind(self, row: Sequence[float]) -> Sequence[float]:
        east, north, up = (row[U_WIND + axis] + row[S_GUST + axis] for axis in range(3))
        return self._given(world_to_body(self._turn, (east, north, up)))

    def _ground(self, row: Sequence[float]) -> Sequence[float]:
        above = row[S_GROUND] - self._origin[2]
        return (-above if self._down else above,)

    def _voltage(self, row: Sequence[float]) -> Sequence[float]:
        return (row[S_VOLTS],)

    def _load(self, row: Sequence[float]) -> Sequence[float]:
        return (row[P_MASS] - self._own_mass,)

    def _push(self, row: Sequence[float]) -> Sequence[float]:
        forward, left, up = (row[P_MASS] * row[U_PUSH + axis] for axis in range(3))
        return self._given((forward, left, up))
