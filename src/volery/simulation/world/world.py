"""The world: all bodies on one grid of time, advanced when one of them is read.

State k holds over [k STEP, (k+1) STEP). An input given in that interval acts from k+1 on. Reading a body
advances it to step now // STEP. Reading changes no result, so no task owns the grid, and whatever holds the
clock (a virtual kernel, the wall clock, firmware in lock step) moves the world by moving the time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from struct import Struct, pack_into
from typing import Final, NamedTuple, Protocol

import numpy as np

from volery.base.errors import UsageError, choices
from volery.base.frames import LocalFrame, Quaternion, Vector
from volery.base.numeric_code import NumericCode
from volery.base.seeds import key
from volery.base.time import MS, Ns
from volery.simulation.world.body_specs import BodySpec, fill_parameters, fill_state
from volery.simulation.world.body_step import advance_bodies
from volery.simulation.world.environment_models import Wind
from volery.simulation.world.scene import Scene
from volery.simulation.world.sensors import (
    Measurement,
    MountedSensor,
    SampledSensor,
    SensorInput,
    added_sensor,
)
from volery.simulation.world.state_layout import (
    ACTIVE_STEPS,
    MOTION_AWAITED,
    MOTION_GIVEN,
    OCTETS,
    P_CAPACITY,
    ROTORS,
    S_AMPS,
    S_ATTITUDE,
    S_CHARGE,
    S_COLLISION,
    S_COLLISIONS,
    S_CONTACT_SPEED,
    S_CONTACTS,
    S_DISTANCE,
    S_ENERGY,
    S_GROUND,
    S_GUST,
    S_ON_GROUND,
    S_PAYLOAD_ENERGY,
    S_POSITION,
    S_RATES,
    S_ROTORS,
    S_SPECIFIC_FORCE,
    S_VELOCITY,
    S_VOLTS,
    STATE,
    U_CURRENT,
    U_GUST,
    U_MOTION,
    U_MOTOR_HEALTH,
    U_MOVED,
    U_PAYLOAD,
    U_THROTTLE,
    U_WIND,
    WORLD,
    Array,
    Bodies,
)

STEP: Final[Ns] = 2 * MS
"""Grid step: 500 Hz."""
_COLUMN, _STATE = Struct("d"), Struct(f"{STATE}d")


class Truth(NamedTuple):
    """True state of a body.

    Args:
        time: Time of the grid step [ns].
        position: East, north, up about the world's origin [m].
        velocity: East, north, up [m/s].
        attitude: Quaternion (w, x, y, z) from body (forward, left, up) to east, north, up.
        rates: Body rates about forward, left, up [rad/s].
        rotors: Rotor speeds [rad/s], 0 beyond their number; rover: steering angle [rad], wheel speed [m/s].
        battery_left: Fraction of the charge left, 0..1.
        charge_as: Charge drawn so far [A s].
        energy_j: Energy drawn so far [J].
        payload_j: Part of it that the on-board computers used [J].
        volts: Voltage at the battery's terminals [V].
        amps: Current drawn [A].
        on_ground: Whether the body touches the ground.
        contact_speed: Downward speed at the last touch-down [m/s].
        contacts: Number of touch-downs.
        ground: Height of the ground straight below, up [m].
        distance: Length of the path so far [m].
    """

    time: Ns
    position: Vector
    velocity: Vector
    attitude: Quaternion
    rates: Vector
    rotors: tuple[float, ...]
    battery_left: float
    charge_as: float
    energy_j: float
    payload_j: float
    volts: float
    amps: float
    on_ground: bool
    contact_speed: float
    contacts: int
    ground: float
    distance: float


class BodyImpact(NamedTuple):
    """How a body hit something that stands in the world.

    Args:
        time: Time of the grid step [ns].
        solid: Name of what it hit.
        speed: Speed into its surface [m/s].
        position: Position of the body: east, north, up about the world's origin [m].
        collisions: Number of collisions of the body so far.
    """

    time: Ns
    solid: str
    speed: float
    position: Vector
    collisions: int


class Attendant(Protocol):
    """What is called at grid steps of a body, such as a firmware in lock step."""

    next_step: int
    """Grid step of the next call."""

    def attend(self) -> None:
        """Act at ``next_step``, which the body has reached and not left, and set the next one."""


class MotionSource(Protocol):
    """What moves a multirotor in place of the world's laws, one grid step after the other."""

    def advance(self, step: int, row: Array) -> Sequence[float]:
        """Return the motion at grid step *step*.

        Args:
            step: The grid step after the one that the body has reached.
            row: The body's state row, with the motor commands in ``W_THROTTLE``; not to be written.

        Returns:
            The columns from ``U_MOTION`` to ``U_CURRENT``.
        """


class _PendingInput:
    """Values for the columns of a row from *column* on, with effect from a grid step."""

    def __init__(self, step: int, column: int, values: tuple[float, ...]) -> None:
        self.step = step
        self.column = column
        self.values = values


def _initial_arrays(
    specs: Sequence[BodySpec], seed: int, frame: LocalFrame, wind: Wind, scene: Scene, columns: int
) -> Bodies:
    """Return the arrays of a world at step 0, with *columns* more columns than the world's own."""
    heights, grid = scene.terrain.arrays()
    rows: Array = np.zeros((len(specs), WORLD + columns))
    for row, spec in zip(rows, specs, strict=True):
        fill_parameters(row, spec, frame, wind)
        fill_state(row, spec, scene.standing_height(spec.at[0], spec.at[1]))
        row[U_MOTOR_HEALTH : U_MOTOR_HEALTH + ROTORS] = 1.0
        row[U_WIND : U_WIND + 3] = wind.east, wind.north, wind.up
        row[U_GUST] = wind.gust
    keys = [key(seed, f"world/body/{index}") for index in range(len(specs))]
    return Bodies(
        rows=rows,
        keys=np.array(keys, dtype=np.uint64),
        reached=np.zeros(len(specs), dtype=np.int64),
        heights=heights,
        grid=grid,
        read=np.full(len(specs), -ACTIVE_STEPS, dtype=np.int64),
        span=np.array((0, len(specs), 0), dtype=np.int64),
        **scene.arrays._asdict(),
    )


class World:
    """All bodies of a run; the rows of its arrays are in their order.

    Args:
        now: Returns the time [ns].
        bodies: The bodies, at least one.
        advance: The compiled step; ``advance_bodies`` has no autopilot and takes motor commands as inputs.
        seed: Seed of all noise.
        frame: Local frame whose origin is the world's.
        wind: Wind; ``None``: still air.
        scene: The ground and what stands in the world; ``None``: level ground. A body that begins where a
            building stands begins on its top.
        columns: Number of columns that *advance* adds to each row.

    Raises:
        UsageError: There are no bodies, or a sensor does not exist.
    """

    def __init__(
        self,
        now: Callable[[], Ns],
        bodies: Sequence[BodySpec],
        *,
        advance: NumericCode = advance_bodies,
        seed: int = 0,
        frame: LocalFrame,
        wind: Wind | None = None,
        scene: Scene | None = None,
        columns: int = 0,
    ) -> None:
        self.now = now
        """Returns the time [ns]."""
        self.frame = frame
        self.specs = tuple(bodies)
        count = len(self.specs)
        if not count:
            raise UsageError("a world without bodies; give at least one")
        self.scene = scene or Scene()
        """The ground and what stands in the world."""
        self.arrays = _initial_arrays(self.specs, seed, frame, wind or Wind(), self.scene, columns)
        self._octets = self.arrays.rows.data.cast("B")
        self._row_octets = self.arrays.rows.strides[0]
        self._reached = self.arrays.reached.data
        self._read = self.arrays.read.data
        self._span = self.arrays.span.data
        self._advance = advance.bind(*self.arrays)
        self._pending: dict[int, deque[_PendingInput]] = {}
        self._mounted = {
            body: {
                sensor.name: MountedSensor(sensor, seed, body, self.scene)
                for sensor in (
                    added_sensor(sensor) if isinstance(sensor, str) else sensor
                    for sensor in spec.added_sensors
                )
            }
            for body, spec in enumerate(self.specs)
            if spec.added_sensors
        }
        self._attendants: dict[int, Attendant] = {}
        self._sources: dict[int, MotionSource] = {}
        self._advance()
        for body in self._mounted:
            self._sample_mounted(body)
        self.advances = 0
        """Number of calls of the compiled step."""

    def advance_to_now(self, body: int) -> int:
        """Advance *body* to the present and return its grid step; its row may then be read, not kept."""
        step = self.now() // STEP
        self._read[body] = step
        if self._reached[body] < step:
            self._catch_up(step)
        return step

    def set_input(self, body: int, column: int, *values: float) -> None:
        """Set inputs of *body*, from *column* of its row on, with effect from the next grid step."""
        pending = self._pending.setdefault(body, deque())
        pending.append(_PendingInput(self.now() // STEP + 1, column, values))

    def attend(self, body: int, attendant: Attendant | None) -> None:
        """Let *attendant* act at grid steps of *body* from now on, in place of another; ``None``: none does.

        It is called while the body is caught up for any reader, so its calls do not depend on who reads.
        """
        if attendant is None:
            self._attendants.pop(body, None)
        else:
            self._attendants[body] = attendant

    def move_by(self, body: int, source: MotionSource | None) -> None:
        """Let *source* move a multirotor from now on; ``None``, or if it raises: it stays where it is."""
        if source is None:
            self._sources.pop(body, None)
        else:
            self._sources[body] = source
        self.arrays.rows[body, U_MOVED] = MOTION_AWAITED

    def command_motors(self, body: int, commands: Sequence[float]) -> None:
        """Set the motor commands of the step that *body* is about to take; for its attendant."""
        pack_into(f"{len(commands)}d", self._octets, self._row_octets * body + OCTETS * U_THROTTLE, *commands)

    def payload_power(self, body: int, watts: float) -> None:
        """Set the electrical power of the computers on *body* [W], from the next grid step on."""
        if watts < 0.0:
            raise UsageError(f"a payload of {watts} W; give 0 or more")
        self.set_input(body, U_PAYLOAD, watts)

    def set_wind(self, wind: Wind) -> None:
        """Set mean wind and gust strength for all bodies, from the next grid step on.

        The correlation time of gusts stays that of the first wind.
        """
        for body in range(len(self.specs)):
            self.set_input(body, U_WIND, wind.east, wind.north, wind.up)
            self.set_input(body, U_GUST, wind.gust)

    def truth(self, body: int) -> Truth:
        """Return the true state of *body* now."""
        step = self.advance_to_now(body)
        start = self._row_octets * body
        row = _STATE.unpack_from(self._octets, start)
        (capacity,) = _COLUMN.unpack_from(self._octets, start + OCTETS * P_CAPACITY)
        return Truth(
            step * STEP,
            row[S_POSITION : S_POSITION + 3],
            row[S_VELOCITY : S_VELOCITY + 3],
            row[S_ATTITUDE : S_ATTITUDE + 4],
            row[S_RATES : S_RATES + 3],
            row[S_ROTORS : S_ROTORS + ROTORS],
            max(0.0, 1.0 - row[S_CHARGE] / capacity),
            row[S_CHARGE],
            row[S_ENERGY],
            row[S_PAYLOAD_ENERGY],
            row[S_VOLTS],
            row[S_AMPS],
            row[S_ON_GROUND] > 0.5,
            row[S_CONTACT_SPEED],
            int(row[S_CONTACTS]),
            row[S_GROUND],
            row[S_DISTANCE],
        )

    def last_collision(self, body: int) -> BodyImpact | None:
        """Return the last collision of *body* so far; ``None``: it has hit nothing."""
        self.advance_to_now(body)
        row = self.arrays.rows[body, : S_COLLISION + 6].tolist()
        if not row[S_COLLISIONS]:
            return None
        step, solid, speed, east, north, up = row[S_COLLISION:]
        name = self.scene.solids[int(solid)].name
        return BodyImpact(int(step) * STEP, name, speed, (east, north, up), int(row[S_COLLISIONS]))

    def measurement(self, body: int, sensor: str) -> Measurement:
        """Return the last sample of an added sensor of *body*.

        Args:
            body: Index of the body.
            sensor: Name of the sensor, one of the spec's ``added_sensors``.

        Raises:
            UsageError: The body has no such sensor.
        """
        mounted = self._mounted.get(body, {})
        if sensor not in mounted:
            there = f"it has {choices(mounted)}" if mounted else "it has no added sensors"
            raise UsageError(f"body {body} has no sensor {sensor!r}; {there}")
        self.advance_to_now(body)
        return mounted[sensor].last

    def added_sensors(self, body: int) -> tuple[SampledSensor, ...]:
        """Return the sensors that are added to *body*."""
        return tuple(mounted.sensor for mounted in self._mounted.get(body, {}).values())

    def _catch_up(self, step: int) -> None:
        """Advance every active body to *step*: those with stops one by one, then all in one call."""
        if self._pending or self._mounted or self._attendants or self._sources:
            stopping = (*self._pending, *self._mounted, *self._attendants, *self._sources)
            for body in dict.fromkeys(stopping):
                if step - self._read[body] < ACTIVE_STEPS:
                    self._catch_up_by_stops(body, step)
        self._advance_span(0, len(self.specs), step)

    def _catch_up_by_stops(self, body: int, step: int) -> None:
        """Advance *body* to its last stop up to *step*; at a stop an input, a sample or a call is due.

        A body that is moved from outside is advanced to *step*, or stays where its source failed.
        """
        while True:
            stops = [sensor.next_step for sensor in self._mounted.get(body, {}).values()]
            if body in self._pending:
                stops.append(self._pending[body][0].step)
            attendant = self._attendants.get(body)
            if attendant is not None:
                stops.append(attendant.next_step)
            stop = min(stops, default=step + 1)
            if body in self._sources:
                self._advance_by_source(body, min(stop, step))
            if stop > step:
                return
            self._advance_span(body, body + 1, stop)
            if self._reached[body] < stop:
                return
            self._sample_mounted(body)
            self._apply_inputs(body)
            if attendant is not None and attendant.next_step == stop:
                attendant.attend()

    def _advance_by_source(self, body: int, step: int) -> None:
        """Advance *body* to *step* by its source: the compiled step writes the commands and awaits motion."""
        row = self.arrays.rows[body]
        while self._reached[body] < step:
            following = self._reached[body] + 1
            self._advance_span(body, body + 1, following)
            try:
                row[U_MOTION : U_CURRENT + 1] = self._sources[body].advance(following, row)
            except BaseException:
                del self._sources[body]
                raise
            row[U_MOVED] = MOTION_GIVEN
            self._advance_span(body, body + 1, following)

    def _advance_span(self, first: int, end: int, step: int) -> None:
        """Advance the active ones of the bodies from *first* to before *end* in one compiled call."""
        self._span[0], self._span[1], self._span[2] = first, end, step
        self._advance()
        self.advances += 1

    def _apply_inputs(self, body: int) -> None:
        """Apply the inputs that are due at the step that *body* has reached."""
        pending = self._pending.get(body)
        reached = self._reached[body]
        while pending and pending[0].step <= reached:
            due = pending.popleft()
            start = self._row_octets * body + OCTETS * due.column
            pack_into(f"{len(due.values)}d", self._octets, start, *due.values)
            if not pending:
                del self._pending[body]

    def _sample_mounted(self, body: int) -> None:
        """Take the samples of the added sensors of *body* that are due at the step reached."""
        reached = self._reached[body]
        for sensor in self._mounted.get(body, {}).values():
            if sensor.next_step == reached:
                sensor.sample(self._sensor_input(body, reached))

    def _sensor_input(self, body: int, step: int) -> SensorInput:
        row = self.arrays.rows[body].tolist()
        wind, gust = row[U_WIND : U_WIND + 3], row[S_GUST : S_GUST + 3]
        return SensorInput(
            time=step * STEP,
            position=tuple(row[S_POSITION : S_POSITION + 3]),
            velocity=tuple(row[S_VELOCITY : S_VELOCITY + 3]),
            attitude=tuple(row[S_ATTITUDE : S_ATTITUDE + 4]),
            rates=tuple(row[S_RATES : S_RATES + 3]),
            specific_force=tuple(row[S_SPECIFIC_FORCE : S_SPECIFIC_FORCE + 3]),
            air_velocity=(wind[0] + gust[0], wind[1] + gust[1], wind[2] + gust[2]),
            ground=row[S_GROUND],
            scene=self.scene,
        )
