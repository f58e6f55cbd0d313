"""Airframes of multirotors, and batteries: what a model may state of a body instead of the simulation's own.

An airframe stands in a file of its own, which any vehicle names. Its laws are in
``volery.simulation.world.dynamics``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import Annotated

from volery.base import units
from volery.base.elementary import sine_cosine
from volery.base.errors import Location
from volery.base.time import MS, Ns
from volery.model.fields import (
    CHARGE,
    PERIOD,
    SHARE,
    TEXT,
    VOLTAGE,
    Key,
    OneOf,
    QuantityField,
    Record,
    Shorter,
)
from volery.model.prices import PRICE, StatedPrice
from volery.model.reading import ModelReading
from volery.model.resources import POWER
from volery.model.text import Path, TextNode

FRAMES = {"quad-x": 4, "quad-plus": 4, "hexa-x": 6, "hexa-plus": 6, "octo-x": 8, "octo-plus": 8}
"""Number of rotors by frame."""

MOST_COMMAND = 0.95
"""Greatest motor command that autopilots give: ArduPilot's MOT_SPIN_MAX. Thrust grows with its square."""
GRAVITY = 9.80665

MASS = QuantityField(units.MASS, above=0)
LOAD = QuantityField(units.MASS, least=0)


@dataclass(frozen=True, slots=True)
class BatterySpec:
    """A battery. Written as its capacity alone, or as a mapping."""

    capacity_coulomb: Annotated[float, CHARGE, "Capacity when full."]
    charge: Annotated[float, SHARE, "Share of the capacity that is left at the start."] = 1.0
    voltage_v: Annotated[
        float | None, VOLTAGE, "Nominal voltage; that of the vehicle's kind if it is not given."
    ] = None
    resistance_ohm: Annotated[
        float | None,
        QuantityField(units.RESISTANCE, above=0),
        "Resistance of the whole battery; with an airframe, by default 11 mOhm a cell over its Ah.",
    ] = None
    price: Annotated[StatedPrice | None, PRICE, "Price of the battery."] = None


BATTERY = Shorter(Record(BatterySpec), key="capacity")


@dataclass(frozen=True, slots=True)
class Propellers:
    """The propellers of an airframe, one on each arm.

    Their power follows from a figure of merit, or from the coefficients of a static test.
    """

    diameter_m: Annotated[float, QuantityField(units.LENGTH, above=0, most=1.5), "Diameter."]
    figure_of_merit: Annotated[
        float, QuantityField(units.RATIO, above=0, most=1), "Ideal power in hover over that of the shaft."
    ] = 0.65
    thrust_coefficient: Annotated[
        float | None,
        QuantityField(units.RATIO, above=0, most=1),
        "Static C_T in T = C_T rho n^2 D^4, with n in turns a second.",
    ] = None
    power_coefficient: Annotated[
        float | None,
        QuantityField(units.RATIO, above=0, most=1),
        "Static C_P in P = C_P rho n^3 D^5; with C_T it gives the figure of merit.",
    ] = None


@dataclass(frozen=True, slots=True)
class Motors:
    """The motors of an airframe with their speed controllers."""

    thrust_n: Annotated[
        float,
        Key("thrust"),
        QuantityField(units.FORCE, above=0),
        "Static thrust of one motor with its propeller, at full throttle and a full battery.",
    ]
    efficiency: Annotated[
        float, QuantityField(units.RATIO, above=0, most=1), "Power at the shaft over that from the battery."
    ] = 0.8
    lag_ns: Annotated[Ns, PERIOD, "Time constant of the rotors' speed."] = 50 * MS


@dataclass(frozen=True, slots=True)
class Airframe:
    """An airframe of a multirotor. Written as the name of its file, or as a mapping."""

    frame: Annotated[str, OneOf(tuple(FRAMES)), "Number of its arms, and which way they point."]
    mass_kg: Annotated[float, MASS, "Mass ready for take-off, with battery and computers, without payload."]
    arm_m: Annotated[
        float, QuantityField(units.LENGTH, above=0, most=2), "Distance of a motor from the centre."
    ]
    propellers: Annotated[Propellers, Record(Propellers), "Its propellers."]
    motors: Annotated[Motors, Record(Motors), "Its motors."]
    battery: Annotated[BatterySpec, BATTERY, "Its battery; the `battery` of a vehicle stands in its place."]
    drag_area_m2: Annotated[
        float | None,
        QuantityField(units.AREA, least=0),
        "Drag coefficient times front area; by default 0.03 m^2 at 1 kg, as the mass to the power 2/3.",
    ] = None
    rotor_drag: Annotated[
        float,
        QuantityField(units.RATIO, least=0, most=2),
        "Momentum drag of the rotors: k in k sqrt(rho A T) v of each.",
    ] = 0.1
    idle_power_w: Annotated[float, POWER, "Power of autopilot, receivers and sensors."] = 5.0
    price: Annotated[StatedPrice | None, PRICE, "Price of the airframe, without battery and computers."] = (
        None
    )
    description: Annotated[str, TEXT, "What it is, and where its figures come from."] = ""
    file: Annotated[str, TEXT, "File with all of this, relative to the model."] = ""
    where: Location | None = field(default=None, compare=False)

    @property
    def spare_kg(self) -> float:
        """Payload with which it just hovers at ``MOST_COMMAND``; negative if it cannot lift itself."""
        lift = FRAMES[self.frame] * self.motors.thrust_n * MOST_COMMAND * MOST_COMMAND
        return lift / GRAVITY - self.mass_kg


class _Airframe(Record):
    """An airframe that can fly."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Airframe:
        """See ``Syntax``."""
        made: Airframe = super().read(node, path, reading)
        rotors, propellers = FRAMES[made.frame], made.propellers
        if made.spare_kg < 0.0:
            needed = made.mass_kg * GRAVITY / (rotors * MOST_COMMAND * MOST_COMMAND)
            what = (
                f"{made.mass_kg:g} kg cannot hover: {rotors} motors of {made.motors.thrust_n:g} N lift "
                f"{made.mass_kg + made.spare_kg:.3g} kg at {MOST_COMMAND:.0%} of their command; state less "
                f"mass, or motors of more than {needed:.3g} N"
            )
            reading.problems.add((*path, "mass"), what)
        if (propellers.thrust_coefficient is None) != (propellers.power_coefficient is None):
            what = "state both thrust_coefficient and power_coefficient, or a figure_of_merit"
            reading.problems.add((*path, "propellers"), what)
        sine, _ = sine_cosine(pi / rotors)
        between = 2.0 * made.arm_m * sine
        if propellers.diameter_m > between:
            what = (
                f"propellers of {propellers.diameter_m:g} m hit one another: arms of {made.arm_m:g} m leave "
                f"{between:.3g} m between two motors"
            )
            reading.problems.add((*path, "propellers", "diameter"), what)
        return made


AIRFRAME = Shorter(
    _Airframe(Airframe, supplied=("frame", "mass", "arm", "propellers", "motors", "battery")), key="file"
)
