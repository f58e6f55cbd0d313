"""Bodies as frozen data, and how they become parameters and initial states of the compiled step.

Defaults describe the bodies that ArduPilot's own simulator flies and drives by default: a quadrotor of 3 kg
with rotors of 0.35 m on three lithium-polymer cells of 3.3 A h, which draws about 28 A in hover, and a rover
the size of a large model car. Inertia, drag and rotor lag are estimated; the power is fitted to the energy
that ArduPilot's simulator reports; its rover draws nothing at rest. The
multirotor flies some seven minutes on a charge.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi, radians, sqrt

from volery.base.elementary import exp, sine_cosine
from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, Vector
from volery.simulation.world.dynamics import CELL_FULL_VOLTS, battery_current
from volery.simulation.world.environment_models import GUST_EVERY, Wind, magnetic_field
from volery.simulation.world.sensors import SampledSensor, fill_sensor_parameters, sensor_suite
from volery.simulation.world.state_layout import (
    MULTIROTOR,
    P_CAPACITY,
    P_CELLS,
    P_DAMPING,
    P_DRAG_LINEAR,
    P_DRAG_QUADRATIC,
    P_DRIVE_EFFICIENCY,
    P_EFFICIENCY,
    P_FEET,
    P_FRICTION,
    P_FULL_VOLTS,
    P_GRAVITY,
    P_GRIP,
    P_GUST_DECAY,
    P_GUST_GAIN,
    P_HOVER_SPEED,
    P_IDLE_POWER,
    P_INERTIA,
    P_INFLOW,
    P_KIND,
    P_MAGNETIC_FIELD,
    P_MASS,
    P_MAX_ROTOR_SPEED,
    P_MAX_SPEED,
    P_MAX_STEERING,
    P_MAX_TURN_RATE,
    P_REACH,
    P_RESISTANCE,
    P_ROLLING,
    P_ROTOR_DECAY,
    P_ROTOR_SPIN,
    P_ROTOR_X,
    P_ROTOR_Y,
    P_ROTORS,
    P_SKID_STEERED,
    P_SPEED_DECAY,
    P_SPIN_DAMPING,
    P_STEERING_DECAY,
    P_STIFFNESS,
    P_THRUST,
    P_TORQUE,
    P_WHEELBASE,
    ROVER,
    S_ATTITUDE,
    S_CHARGE,
    S_GROUND,
    S_ON_GROUND,
    S_POSITION,
    S_RESTING,
    STEP_S,
    Array,
)

AIR_DENSITY = 1.225  # [kg/m^3], ISA at sea level
STANDARD_GRAVITY = 9.80665  # [m/s^2], CGPM 1901
MOST_COMMAND = 0.95
"""Greatest motor command that autopilots give: ArduPilot's MOT_SPIN_MAX."""


_MULTIROTOR_POSITIVE = (
    "mass",
    "inertia",
    "thrust_coefficient",
    "propeller_diameter",
    "figure_of_merit",
    "efficiency",
    "top_speed",
    "rotor_lag",
    "feet",
)
_ROVER_POSITIVE = (
    "mass",
    "wheelbase",
    "steer_top_deg",
    "steer_lag",
    "speed_top",
    "speed_lag",
    "efficiency",
    "grip",
    "turn_top_deg",
)


def _above_zero(noun: str, spec: object, names: tuple[str, ...]) -> None:
    """Raise ``UsageError`` for parameters that must be above zero and are not."""
    for name in names:
        value = getattr(spec, name)
        if not all(figure > 0.0 for figure in (value if isinstance(value, tuple) else (value,))):
            raise UsageError(f"{noun}: {name} is {value}; give more than 0")


@dataclass(frozen=True)
class BatteryPack:
    """A lithium-polymer pack.

    Args:
        capacity_ah: Capacity [A h].
        cells: Number of cells in series.
        resistance_ohm: Resistance of the whole pack [ohm].
        left: Fraction of the charge left at the start, above 0 and at most 1.
    """

    capacity_ah: float = 3.3
    cells: int = 3
    resistance_ohm: float = 0.010
    left: float = 1.0

    def __post_init__(self) -> None:
        if self.capacity_ah <= 0.0 or self.cells < 1 or self.resistance_ohm <= 0.0:
            raise UsageError(f"battery: capacity, cells and resistance must be above zero, not {self}")
        if not 0.0 < self.left <= 1.0:
            raise UsageError(f"battery: the fraction left is {self.left}; give one above 0 and at most 1")


@dataclass(frozen=True)
class Rotor:
    """Position of a rotor and its sense of rotation.

    Args:
        forward: Distance forward of the centre [m].
        left: Distance left of the centre [m].
        spin: +1 if the reaction torque turns the body to the left, else -1.
    """

    forward: float
    left: float
    spin: int


def x_frame(arm: float) -> tuple[Rotor, Rotor, Rotor, Rotor]:
    """Return four rotors on arms at 45 degrees, in ArduPilot's motor order for QUAD/X.

    Front right and rear left turn anticlockwise seen from above (reaction to the right), the other two
    clockwise.

    Args:
        arm: Distance of the rotors from the centre [m].
    """
    side = arm * sqrt(0.5)
    return Rotor(side, -side, -1), Rotor(-side, side, -1), Rotor(side, side, 1), Rotor(-side, -side, 1)


FRAMES: Mapping[str, tuple[tuple[float, int], ...]] = {
    "quad-x": ((45.0, -1), (-135.0, -1), (-45.0, 1), (135.0, 1)),
    "quad-plus": ((90.0, -1), (-90.0, -1), (0.0, 1), (180.0, 1)),
    "hexa-x": ((90.0, 1), (-90.0, -1), (-30.0, 1), (150.0, -1), (30.0, -1), (-150.0, 1)),
    "hexa-plus": ((0.0, 1), (180.0, -1), (-120.0, 1), (60.0, -1), (-60.0, -1), (120.0, 1)),
    "octo-x": (
        (22.5, 1), (-157.5, 1), (67.5, -1), (157.5, -1), (-22.5, -1), (-112.5, -1), (-67.5, 1), (112.5, 1)
    ),
    "octo-plus": (
        (0.0, 1), (180.0, 1), (45.0, -1), (135.0, -1), (-45.0, -1), (-135.0, -1), (-90.0, 1), (90.0, 1)
    ),
}  # fmt: skip
"""Rotors in ArduPilot's motor order (AP_MotorsMatrix): angle clockwise from the nose [degrees], spin."""


def frame_rotors(frame: str, arm: float) -> tuple[Rotor, ...]:
    """Return the rotors of a frame, one of ``FRAMES``.

    Args:
        frame: Name of the frame.
        arm: Distance of the rotors from the centre [m].
    """
    found = []
    for degrees, spin in FRAMES[frame]:
        s, c = sine_cosine(radians(degrees))
        found.append(Rotor(arm * c, -arm * s, spin))
    return tuple(found)


@dataclass(frozen=True)
class Multirotor:
    """A body with four, six or eight rotors.

    Args:
        at: Initial position east, north, up about the world's origin [m]; the height is the ground's.
        heading_deg: Initial heading, clockwise from north [degrees].
        sensors: Name of the sensor suite.
        added_sensors: Sensors that are mounted; those of the entry points ``volery.sensors`` by their names.
        battery: The battery.
        mass: Mass [kg].
        inertia: Principal moments of inertia about forward, left, up [kg m^2].
        rotors: The rotors, in the order of the motors.
        frame: Name of the frame in ``FRAMES``, for which the autopilot is configured; empty: the usual
            body, for which it is configured by default.
        payload: Mass that it carries from the start, beside its own [kg].
        thrust_coefficient: k_T in thrust = k_T w^2 [N s^2].
        propeller_diameter: Diameter [m].
        figure_of_merit: Ideal over real induced power of a rotor in hover, 0..1.
        efficiency: Efficiency of motor and speed controller, 0..1.
        top_speed: Rotor speed at full throttle and full battery [rad/s].
        rotor_lag: Time constant of rotor speed [s].
        drag_linear: Linear drag coefficient with the rotors in hover [N s/m]; it grows with their speed.
        drag_quadratic: Quadratic drag coefficient [N s^2/m^2].
        spin_damping: Damping of body rates [N m s/rad].
        feet: Half length, half width and depth below the centre of the landing gear [m].
        friction: Coulomb friction coefficient of the feet.
        idle_power: Power of autopilot, receivers and sensors [W].
    """

    at: Vector = (0.0, 0.0, 0.0)
    heading_deg: float = 0.0
    sensors: str = "consumer"
    added_sensors: tuple[str | SampledSensor, ...] = ()
    battery: BatteryPack = BatteryPack()
    mass: float = 3.0
    inertia: Vector = (0.040, 0.040, 0.089)
    rotors: tuple[Rotor, ...] = field(default_factory=lambda: x_frame(0.25))
    frame: str = ""
    payload: float = 0.0
    thrust_coefficient: float = 4.0e-5
    propeller_diameter: float = 0.35
    figure_of_merit: float = 0.6
    efficiency: float = 0.8
    top_speed: float = 760.0
    rotor_lag: float = 0.04
    drag_linear: float = 0.73
    drag_quadratic: float = 0.10
    spin_damping: float = 0.004
    feet: Vector = (0.15, 0.15, 0.12)
    friction: float = 0.6
    idle_power: float = 3.0

    def __post_init__(self) -> None:
        _above_zero("multirotor", self, _MULTIROTOR_POSITIVE)
        if self.payload > self.spare_lift:
            raise UsageError(
                f"a payload of {self.payload:g} kg is too heavy: beside {self.mass:g} kg of its own "
                f"it can lift {max(0.0, self.spare_lift):.2g} kg"
            )

    @property
    def reach(self) -> float:
        """Distance of the rotors' tips from the centre [m]."""
        arm = max(sqrt(rotor.forward * rotor.forward + rotor.left * rotor.left) for rotor in self.rotors)
        return arm + 0.5 * self.propeller_diameter

    @property
    def torque_coefficient(self) -> float:
        """k_Q = k_T^1.5 / (FM sqrt(2 rho A)) [N m s^2]: see ``dynamics``."""
        disc = pi * self.propeller_diameter * self.propeller_diameter / 4.0
        induced = sqrt(2.0 * AIR_DENSITY * disc)
        coefficient: float = (
            self.thrust_coefficient * sqrt(self.thrust_coefficient) / (self.figure_of_merit * induced)
        )
        return coefficient

    @property
    def hover_speed(self) -> float:
        """Rotor speed at which the thrust equals the weight [rad/s]."""
        return sqrt(self.weight / (len(self.rotors) * self.thrust_coefficient))

    @property
    def weight(self) -> float:
        """Weight with the payload that it carries from the start [N]."""
        return (self.mass + self.payload) * STANDARD_GRAVITY

    @property
    def hover_throttle(self) -> float:
        """Motor command 0..1 in hover, with a full battery."""
        return self.hover_speed / self.top_speed

    @property
    def spare_lift(self) -> float:
        """Payload with which it hovers on a full battery at ``MOST_COMMAND`` [kg]; may be negative."""
        command = MOST_COMMAND * self.top_speed
        return len(self.rotors) * self.thrust_coefficient * command * command / STANDARD_GRAVITY - self.mass

    @property
    def authority(self) -> Vector:
        """Angular acceleration for a difference of full thrust between motors, about forward, left, up."""
        full = self.thrust_coefficient * self.top_speed * self.top_speed
        reach = max(max(abs(rotor.forward), abs(rotor.left)) for rotor in self.rotors)
        roll = sum(rotor.left * rotor.left for rotor in self.rotors) / reach
        pitch = sum(rotor.forward * rotor.forward for rotor in self.rotors) / reach
        yaw = len(self.rotors) * self.torque_coefficient / self.thrust_coefficient
        return (
            full * roll / self.inertia[0], full * pitch / self.inertia[1], full * yaw / self.inertia[2]
        )  # fmt: skip

    def top_level_speed(self, tilt: float) -> float:
        """Return the speed of level flight at a tilt [rad], against the drag of ``dynamics`` [m/s]."""
        s, c = sine_cosine(tilt)
        low, high = 0.0, 200.0
        for _ in range(60):
            speed = 0.5 * (low + high)
            drag = (self.drag_linear + self.drag_quadratic * speed) * speed
            low, high = (speed, high) if drag * c < self.weight * s else (low, speed)
        return low

    @property
    def hover_power(self) -> float:
        """Electrical power in hover, without computers [W]."""
        speed = self.hover_speed
        shaft = len(self.rotors) * self.torque_coefficient * speed * speed * speed
        return shaft / self.efficiency + self.idle_power

    @property
    def hover_current(self) -> float:
        """Current in hover with a full battery [A]."""
        battery = self.battery
        current: float = battery_current(
            battery.cells * CELL_FULL_VOLTS, battery.resistance_ohm, self.hover_power
        )
        return current


@dataclass(frozen=True)
class WheeledRover:
    """A rover that steers like a car, or is skid-steered.

    Args:
        at: Initial position east, north, up about the world's origin [m]; the height is the ground's.
        heading_deg: Initial heading, clockwise from north [degrees].
        sensors: Name of the sensor suite.
        added_sensors: Sensors that are mounted; those of the entry points ``volery.sensors`` by their names.
        battery: The battery.
        mass: Mass [kg].
        wheelbase: Distance between the axles [m].
        steer_top_deg: Largest steering angle [degrees].
        steer_lag: Time constant of steering [s].
        speed_top: Speed at full throttle [m/s].
        speed_lag: Time constant of speed [s].
        rolling: Rolling resistance coefficient.
        efficiency: Efficiency of the drive, 0..1.
        drag_linear: Linear drag coefficient [N s/m].
        drag_quadratic: Quadratic drag coefficient [N s^2/m^2].
        grip: Largest acceleration that the tyres give [m/s^2].
        skid: Whether it is skid-steered: steering then commands a turn rate.
        turn_top_deg: Skid-steered: turn rate at full steering [degrees/s].
        idle_power: Power of autopilot, receivers and sensors [W].
    """

    at: Vector = (0.0, 0.0, 0.0)
    heading_deg: float = 0.0
    sensors: str = "consumer"
    added_sensors: tuple[str | SampledSensor, ...] = ()
    battery: BatteryPack = BatteryPack(capacity_ah=10.0)
    mass: float = 8.0
    wheelbase: float = 0.4
    steer_top_deg: float = 30.0
    steer_lag: float = 0.12
    speed_top: float = 20.0
    speed_lag: float = 1.7
    rolling: float = 0.03
    efficiency: float = 0.216
    drag_linear: float = 0.0
    drag_quadratic: float = 0.3
    grip: float = 4.0
    skid: bool = False
    turn_top_deg: float = 120.0
    idle_power: float = 0.0

    def __post_init__(self) -> None:
        _above_zero("rover", self, _ROVER_POSITIVE)

    @property
    def reach(self) -> float:
        """Half of the length [m]: the wheels reach beyond the axles."""
        return 0.75 * self.wheelbase


BodySpec = Multirotor | WheeledRover


def _decay_in_half_a_step(lag: float) -> float:
    """Return the factor on a distance from its target over half a step, of a quantity with a lag [s]."""
    return exp(-0.5 * STEP_S / lag)


def _fill_multirotor(row: Array, spec: Multirotor) -> None:
    weight = spec.mass * STANDARD_GRAVITY
    row[P_ROTORS] = len(spec.rotors)
    row[P_KIND] = MULTIROTOR
    row[P_INERTIA : P_INERTIA + 3] = spec.inertia
    row[P_SPIN_DAMPING] = spec.spin_damping
    row[P_FEET : P_FEET + 3] = spec.feet
    row[P_STIFFNESS] = weight / 4.0 / 0.005  # the springs of the feet yield by 5 mm at rest
    row[P_DAMPING] = sqrt(spec.mass * row[P_STIFFNESS]) * 0.8  # a little below critical for four feet
    row[P_FRICTION] = spec.friction
    for index, rotor in enumerate(spec.rotors):
        row[P_ROTOR_X + index] = rotor.forward
        row[P_ROTOR_Y + index] = rotor.left
        row[P_ROTOR_SPIN + index] = rotor.spin
    row[P_THRUST] = spec.thrust_coefficient
    row[P_TORQUE] = spec.torque_coefficient
    row[P_ROTOR_DECAY] = _decay_in_half_a_step(spec.rotor_lag)
    row[P_MAX_ROTOR_SPEED] = spec.top_speed
    row[P_EFFICIENCY] = spec.efficiency
    row[P_HOVER_SPEED] = spec.hover_speed
    jet = 2.0 * spec.hover_power / weight
    row[P_INFLOW] = weight / (jet * jet)


def _fill_rover(row: Array, spec: WheeledRover) -> None:
    row[P_KIND] = ROVER
    row[P_WHEELBASE] = spec.wheelbase
    row[P_MAX_STEERING] = radians(spec.steer_top_deg)
    row[P_STEERING_DECAY] = _decay_in_half_a_step(spec.steer_lag)
    row[P_MAX_SPEED] = spec.speed_top
    row[P_SPEED_DECAY] = _decay_in_half_a_step(spec.speed_lag)
    row[P_ROLLING] = spec.rolling
    row[P_DRIVE_EFFICIENCY] = spec.efficiency
    row[P_SKID_STEERED] = float(spec.skid)
    row[P_MAX_TURN_RATE] = radians(spec.turn_top_deg)
    row[P_GRIP] = spec.grip


def fill_parameters(row: Array, spec: BodySpec, frame: LocalFrame, wind: Wind) -> None:
    """Write the parameters of a body into its state row.

    Args:
        row: The body's row, zeros before.
        spec: The body.
        frame: The world's local frame, which gives the magnetic field.
        wind: The wind, which gives the correlation time of gusts.
    """
    row[P_MASS] = spec.mass + (spec.payload if isinstance(spec, Multirotor) else 0.0)
    row[P_REACH] = spec.reach
    row[P_DRAG_LINEAR] = spec.drag_linear
    row[P_DRAG_QUADRATIC] = spec.drag_quadratic
    row[P_CAPACITY] = spec.battery.capacity_ah * 3600.0
    row[P_CELLS] = spec.battery.cells
    row[P_RESISTANCE] = spec.battery.resistance_ohm
    row[P_FULL_VOLTS] = 0.0
    row[P_IDLE_POWER] = spec.idle_power
    decay = exp(-GUST_EVERY * STEP_S / wind.gust_time)
    row[P_GUST_DECAY], row[P_GUST_GAIN] = decay, sqrt(1.0 - decay * decay)
    row[P_GRAVITY] = STANDARD_GRAVITY
    row[P_MAGNETIC_FIELD : P_MAGNETIC_FIELD + 3] = magnetic_field(frame)
    if isinstance(spec, Multirotor):
        _fill_multirotor(row, spec)
        row[P_FULL_VOLTS] = spec.battery.cells * CELL_FULL_VOLTS
    else:
        _fill_rover(row, spec)
    fill_sensor_parameters(row, sensor_suite(spec.sensors))


def fill_state(row: Array, spec: BodySpec, ground: float) -> None:
    """Write the initial state: at rest at ``spec.at``, with the spec's heading.

    Args:
        row: The body's row.
        spec: The body.
        ground: Height of what it stands on, about the world's origin, up [m].
    """
    depth = spec.feet[2] - 0.005 if isinstance(spec, Multirotor) else 0.0
    row[S_POSITION : S_POSITION + 3] = spec.at[0], spec.at[1], ground + depth
    half = (pi / 2.0 - radians(spec.heading_deg)) / 2.0
    row[S_ATTITUDE + 3], row[S_ATTITUDE] = sine_cosine(half)
    row[S_CHARGE] = (1.0 - spec.battery.left) * spec.battery.capacity_ah * 3600.0
    row[S_GROUND] = ground
    row[S_ON_GROUND] = row[S_RESTING] = 1.0
