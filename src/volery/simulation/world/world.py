"""The world: all bodies on one grid of time, advanced when somebody looks.

State k holds over [k STEP, (k+1) STEP); an input given in that interval acts from k+1 on; a look advances to
now // STEP. So looking is free and changes nothing, nobody owns the tick, and whoever holds the clock (a
virtual kernel, the wall, firmware in lock step) moves the world by moving ``now``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, Quaternion, Vector
from volery.base.seeds import key
from volery.base.time import MS, Ns
from volery.simulation.world.body_specs import BodySpec, fill_parameters, fill_state
from volery.simulation.world.body_step import advance_bodies
from volery.simulation.world.environment_models import Terrain, Wind
from volery.simulation.world.state_layout import (
    P_CAPACITY,
    S_AMPS,
    S_ATTITUDE,
    S_CHARGE,
    S_CONTACT_SPEED,
    S_CONTACTS,
    S_DISTANCE,
    S_ENERGY,
    S_GROUND,
    S_ON_GROUND,
    S_PAYLOAD_ENERGY,
    S_POSITION,
    S_RATES,
    S_ROTORS,
    S_VELOCITY,
    S_VOLTS,
    STATE,
    U_GUST,
    U_MOTOR_HEALTH,
    U_PAYLOAD,
    U_WIND,
    WORLD,
    Advance,
    Array,
    Bodies,
)

STEP: Ns = 2 * MS
"""The grid: 500 Hz."""

_WATCHED = 500
"""A body looked at within this many steps is advanced along with the others, in one compiled call."""


class Truth(NamedTuple):
    """What is really so: ENU about the world's origin, body axes forward, left, up; SI units.

    ``charge_as`` ampere-seconds and ``energy_j`` drawn so far (``payload_j`` of it by on-board computers),
    ``battery_left`` a fraction, ``contact_speed`` downward at the last touch-down, ``contacts`` how many
    there were, ``rotors`` rad/s (rover: steering angle rad, wheel speed m/s, 0, 0), ``ground`` height of the
    ground below.
    """

    time: Ns
    position: Vector
    velocity: Vector
    attitude: Quaternion
    rates: Vector
    rotors: tuple[float, float, float, float]
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


class _Dated(NamedTuple):
    step: int
    column: int
    values: tuple[float, ...]


def _furnish(
    specs: Sequence[BodySpec], seed: int, frame: LocalFrame, air: Wind, ground: Terrain, own: int
) -> Bodies:
    """The arrays of a world at its first moment; *own* is how many columns its composer adds."""
    heights, grid = ground.arrays()
    rows: Array = np.zeros((len(specs), WORLD + own))
    for row, spec in zip(rows, specs, strict=True):
        fill_parameters(row, spec, frame, air)
        fill_state(row, spec, ground)
        row[U_MOTOR_HEALTH : U_MOTOR_HEALTH + 4] = 1.0
        row[U_WIND : U_WIND + 3] = air.east, air.north, air.up
        row[U_GUST] = air.gust
    keys = [key(seed, f"world/body/{index}") for index in range(len(specs))]
    return Bodies(
        rows=rows,
        keys=np.array(keys, dtype=np.uint64),
        reached=np.zeros(len(specs), dtype=np.int64),
        heights=heights,
        grid=grid,
    )


class World:
    """All bodies of a run. Rows of its arrays are in the order of *bodies*.

    *advance* is the compiled step; ``advance_bodies`` flies nothing and takes motor commands as inputs.
    *columns* is how many a composer adds to each row.
    """

    def __init__(
        self,
        now: Callable[[], Ns],
        bodies: Sequence[BodySpec],
        *,
        advance: Advance = advance_bodies,
        seed: int = 0,
        frame: LocalFrame,
        wind: Wind | None = None,
        terrain: Terrain | None = None,
        columns: int = 0,
    ) -> None:
        self._now = now
        self._advance = advance
        self.frame = frame
        self.specs = tuple(bodies)
        count = len(self.specs)
        if not count:
            raise UsageError("a world without bodies; give at least one")
        self.arrays = _furnish(self.specs, seed, frame, wind or Wind(), terrain or Terrain(), columns)
        self._dated: list[deque[_Dated]] = [deque() for _ in self.specs]
        self._looked = [-_WATCHED] * count
        self._goals = np.zeros(count, dtype=np.int64)
        self._advance(self.arrays, self._goals)
        self.advances = 0

    def look(self, body: int) -> int:
        """Bring *body* to the present and return its grid step; its rows may then be read, not kept."""
        step = self._now() // STEP
        self._looked[body] = step
        if self.arrays.reached[body] < step:
            self._catch_up(step)
        return step

    def drive(self, body: int, column: int, *values: float) -> None:
        """Set inputs of *body* from *column* on; dated to the next grid step."""
        self._dated[body].append(_Dated(self._now() // STEP + 1, column, values))

    def payload_power(self, body: int, watts: float) -> None:
        """Electrical power of the computers that *body* carries, from the next grid step on [W]."""
        if watts < 0.0:
            raise UsageError(f"a payload of {watts} W; give 0 or more")
        self.drive(body, U_PAYLOAD, watts)

    def set_wind(self, wind: Wind) -> None:
        """Another mean wind and gust strength for all, from the next grid step on (the gusts' time constant
        stays).
        """
        for body in range(len(self.specs)):
            self.drive(body, U_WIND, wind.east, wind.north, wind.up)
            self.drive(body, U_GUST, wind.gust)

    def truth(self, body: int) -> Truth:
        """The true state of *body* now."""
        step = self.look(body)
        row = self.arrays.rows[body, :STATE].tolist()
        capacity = float(self.arrays.rows[body, P_CAPACITY])
        return Truth(
            time=step * STEP,
            position=tuple(row[S_POSITION : S_POSITION + 3]),
            velocity=tuple(row[S_VELOCITY : S_VELOCITY + 3]),
            attitude=tuple(row[S_ATTITUDE : S_ATTITUDE + 4]),
            rates=tuple(row[S_RATES : S_RATES + 3]),
            rotors=tuple(row[S_ROTORS : S_ROTORS + 4]),
            battery_left=max(0.0, 1.0 - row[S_CHARGE] / capacity),
            charge_as=row[S_CHARGE],
            energy_j=row[S_ENERGY],
            payload_j=row[S_PAYLOAD_ENERGY],
            volts=row[S_VOLTS],
            amps=row[S_AMPS],
            on_ground=row[S_ON_GROUND] > 0.5,
            contact_speed=row[S_CONTACT_SPEED],
            contacts=int(row[S_CONTACTS]),
            ground=row[S_GROUND],
            distance=row[S_DISTANCE],
        )

    def _catch_up(self, step: int) -> None:
        """Bring every watched body to *step*, stopping where an input falls due."""
        watched = [body for body, looked in enumerate(self._looked) if step - looked < _WATCHED]
        while True:
            due = False
            for body in watched:
                self._apply(body)
                dated = self._dated[body]
                waits = bool(dated) and dated[0].step <= step
                self._goals[body] = dated[0].step if waits else step
                due = due or waits
            self._advance(self.arrays, self._goals)
            self.advances += 1
            if not due:
                return

    def _apply(self, body: int) -> None:
        """Put into force the inputs that are dated to where *body* stands."""
        dated = self._dated[body]
        reached = int(self.arrays.reached[body])
        while dated and dated[0].step <= reached:
            _, column, values = dated.popleft()
            self.arrays.rows[body, column : column + len(values)] = values
