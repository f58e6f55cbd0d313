"""The bodies of the vehicles of a model: airframe, battery and payload as the simulation takes them.

The laws of an airframe are those of ``volery.simulation.world.dynamics``. What its file does not state is
scaled from the usual body: moments of inertia, feet, and the damping of rotation.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt

from volery.base.elementary import exp, log
from volery.base.errors import ModelError, UsageError
from volery.base.time import to_seconds
from volery.model.airframes import FRAMES, Airframe, Propellers
from volery.model.airframes import BatterySpec as BatteryModel
from volery.model.environment import VehicleSpec
from volery.run.assembly.mounted_sensors import sensors_of
from volery.simulation.world.body_specs import (
    AIR_DENSITY,
    STANDARD_GRAVITY,
    BatteryPack,
    BodySpec,
    Multirotor,
    WheeledRover,
    frame_rotors,
)

CELL_NOMINAL_VOLTS = 3.7
CELL_RESISTANCE = 0.011
"""Resistance of a cell times its capacity [Ohm A h]: that of the usual body's battery."""
TYPICAL_THRUST_COEFFICIENT = 0.1
"""C_T of a propeller whose figure of merit is stated: it sets the speed of rotation and no power."""
_ROLL_INERTIA, _YAW_INERTIA = 0.21, 0.475
"""Moments of inertia over mass and square of the arm."""
_SPIN_DAMPING = 0.1
"""Damping of rotation over the moment of inertia [1/s]."""
_FOOT, _DEPTH = 0.6, 0.48
"""Half length and depth of the feet over the arm."""
_DRAG_AREA = 0.03
"""Drag area of a body of 1 kg [m^2]."""


def body_of(vehicle: VehicleSpec) -> BodySpec:
    """Return the body of a vehicle at its place in the model.

    Raises:
        ModelError: It cannot fly with its payload.
    """
    body: BodySpec
    if vehicle.kind != "multirotor":
        usual = WheeledRover()
        mass = usual.mass + vehicle.payload_kg
        body = replace(usual, mass=mass, battery=_battery(vehicle.battery, usual.battery))
    elif vehicle.airframe is not None:
        body = _own_multirotor(vehicle.airframe, vehicle.battery or vehicle.airframe.battery)
    else:
        plain = Multirotor()
        body = replace(plain, battery=_battery(vehicle.battery, plain.battery))
    body = replace(
        body,
        at=(vehicle.at.east_m, vehicle.at.north_m, 0.0),
        heading_deg=vehicle.heading_deg,
        sensors=vehicle.sensors,
        added_sensors=tuple(sensors_of(vehicle)),
    )
    if not isinstance(body, Multirotor) or not vehicle.payload_kg:
        return body
    try:
        return replace(body, payload=vehicle.payload_kg)
    except UsageError as error:
        at = f"environment.vehicles.{vehicle.name}.payload"
        raise ModelError(str(error), at, vehicle.where) from None


def _battery(model: BatteryModel | None, usual: BatteryPack) -> BatteryPack:
    if model is None:
        return usual
    resistance = usual.resistance_ohm if model.resistance_ohm is None else model.resistance_ohm
    return BatteryPack(model.capacity_coulomb / 3600.0, _cells(model, usual), resistance, model.charge)


def _cells(model: BatteryModel, usual: BatteryPack) -> int:
    return usual.cells if model.voltage_v is None else max(1, round(model.voltage_v / CELL_NOMINAL_VOLTS))


def _own_multirotor(airframe: Airframe, model: BatteryModel) -> Multirotor:
    """Return the body of an airframe with a battery."""
    rotors, arm, mass = FRAMES[airframe.frame], airframe.arm_m, airframe.mass_kg
    propellers = airframe.propellers
    merit, per_square = _propeller_laws(propellers)
    disc = pi * propellers.diameter_m * propellers.diameter_m / 4.0
    hover_thrust = mass * STANDARD_GRAVITY / rotors
    area = airframe.drag_area_m2
    if area is None:
        area = _DRAG_AREA * exp(log(mass) * 2.0 / 3.0)
    cells, ampere_hours = _cells(model, BatteryPack()), model.capacity_coulomb / 3600.0
    resistance = model.resistance_ohm or CELL_RESISTANCE * cells / ampere_hours
    roll = _ROLL_INERTIA * mass * arm * arm
    return Multirotor(
        frame=airframe.frame,
        rotors=frame_rotors(airframe.frame, arm),
        mass=mass,
        inertia=(roll, roll, _YAW_INERTIA * mass * arm * arm),
        thrust_coefficient=per_square,
        propeller_diameter=propellers.diameter_m,
        figure_of_merit=merit,
        efficiency=airframe.motors.efficiency,
        top_speed=sqrt(airframe.motors.thrust_n / per_square),
        rotor_lag=to_seconds(airframe.motors.lag_ns),
        drag_linear=airframe.rotor_drag * rotors * sqrt(AIR_DENSITY * disc * hover_thrust),
        drag_quadratic=0.5 * AIR_DENSITY * area,
        spin_damping=_SPIN_DAMPING * roll,
        feet=(_FOOT * arm, _FOOT * arm, _DEPTH * arm),
        idle_power=airframe.idle_power_w,
        battery=BatteryPack(ampere_hours, cells, resistance, model.charge),
    )


def _propeller_laws(propellers: Propellers) -> tuple[float, float]:
    """Return figure of merit and k_T [N s^2] of a propeller.

    T = C_T rho n^2 D^4 and P = C_P rho n^3 D^5 with n = w / 2 pi give k_T = C_T rho D^4 / (2 pi)^2, and with
    the ideal power of momentum theory FM = sqrt(2 / pi) C_T^1.5 / C_P (Leishman, Principles of Helicopter
    Aerodynamics, 2.3, in the coefficients of propellers).
    """
    thrust, power = propellers.thrust_coefficient, propellers.power_coefficient
    merit = propellers.figure_of_merit
    if thrust is not None and power is not None:
        merit = sqrt(2.0 / pi) * thrust * sqrt(thrust) / power
    square = propellers.diameter_m * propellers.diameter_m
    k_t = (thrust or TYPICAL_THRUST_COEFFICIENT) * AIR_DENSITY * square * square / (4.0 * pi * pi)
    return merit, k_t
