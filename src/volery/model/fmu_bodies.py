"""An FMU that moves a multirotor in place of the simulation's own laws, and the names of its variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path as FilePath
from typing import Annotated

from volery.model.components import FileBeside
from volery.model.fields import NUMBER, TEXT, Key, ListOf, MapOf, OneOf, Record

AXES = ("flu", "frd")
_NAMES = ListOf(TEXT, least=1, bare=True)
Names = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FmuVariables:
    """What the variables of an FMU are called.

    Several values have a name each, or one name: that of an array, or `position` for `position[1]`,
    `position[2]` and so on. `world` axes are those of the body at the start, with the origin on the ground.
    """

    commands: Annotated[
        Names, _NAMES, "Input, required: motor commands 0..1, one for each motor, in ArduPilot's order."
    ] = ("commands",)
    wind: Annotated[Names, _NAMES, "Input: velocity of the air, 3 values in world axes [m/s]."] = ("wind",)
    ground: Annotated[
        Names, _NAMES, "Input: where the ground below it is along the third world axis, 0 at the start [m]."
    ] = ("ground",)
    voltage: Annotated[Names, _NAMES, "Input: voltage at the battery's terminals [V]."] = ("voltage",)
    load: Annotated[Names, _NAMES, "Input: mass that it carries beside its own [kg]."] = ("load",)
    push: Annotated[Names, _NAMES, "Input: force from outside, 3 values in body axes [N]."] = ("push",)
    position: Annotated[Names, _NAMES, "Output, required: position of its centre, 3 values [m]."] = (
        "position",
    )
    velocity: Annotated[
        Names, _NAMES, "Output, required: velocity over the ground, 3 values in world axes [m/s]."
    ] = ("velocity",)
    attitude: Annotated[
        Names, _NAMES, "Output: quaternion w, x, y, z from body to world axes; or else `angles`."
    ] = ("attitude",)
    angles: Annotated[
        Names,
        _NAMES,
        "Output: roll, pitch and yaw about the body's axes, yaw first [rad]; or else `attitude`.",
    ] = ("angles",)
    rates: Annotated[Names, _NAMES, "Output, required: body rates, 3 values in body axes [rad/s]."] = (
        "rates",
    )
    specific_force: Annotated[
        Names,
        _NAMES,
        "Output: reading of an ideal accelerometer, 3 values in body axes [m/s^2]; else from velocities.",
    ] = ("specific_force",)
    rotor_speeds: Annotated[
        Names, _NAMES, "Output: speed of each rotor [rad/s]; else as the airframe's lag has it."
    ] = ("rotor_speeds",)
    current: Annotated[
        Names, _NAMES, "Output: current of the rotors [A]; else that of the airframe's propellers."
    ] = ("current",)

    def stated(self) -> frozenset[str]:
        """Return the quantities whose names differ from the usual ones: the FMU must have these."""
        return frozenset(one.name for one in fields(self) if getattr(self, one.name) != (one.name,))


@dataclass(frozen=True, slots=True)
class Fmu:
    """A co-simulation FMU of FMI 2 or 3 that moves a multirotor in place of the simulation's own laws.

    The autopilot is configured for the airframe of the vehicle, which also states the battery.
    """

    file: Annotated[FilePath, Key("fmu"), FileBeside(), "Its file, relative to the model."]
    axes: Annotated[
        str,
        OneOf(AXES),
        "Axes of body and world: `flu` forward, left, up or `frd` forward, right, down.",
    ] = "flu"
    variables: Annotated[
        FmuVariables, Record(FmuVariables), "Names of its variables that differ from the usual ones."
    ] = FmuVariables()
    parameters: Annotated[
        Mapping[str, float], MapOf(NUMBER, free=True), "Start values of its parameters, by its own names."
    ] = field(default_factory=dict)


FMU = Record(Fmu)
