"""Fault trials: one fault in one phase of a flight, the reaction of the aircraft, and the result of the call.

Each phase is a small program, which calls ``strike`` at the time of the fault and then continues; for a fault
during a call, ``strike`` is scheduled a moment later. A trial demands of every driver and autopilot: no call
hangs; it succeeds or raises an error of this project that names the vehicle; success agrees with the
vehicle's true state; nothing is done twice; modes of other commanders are not overridden; and the vehicle
lands in the end: motors never off in the air, upright, slower than it breaks, before the battery is empty.
The judge is the simulation's truth, not the autopilot's estimate.

The faults are kinds of the catalogue (``volery.model.faults``), with the effects that they have in a model.
Only here are the two kinds that a model cannot state: another station that takes over, and the death of the
program.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count, pairwise
from math import acos, atan2, degrees, dist, hypot
from typing import Any, TypeVar

from volery.base.errors import VoleryError
from volery.base.time import MINUTE, MS, Ns, S, from_seconds, to_seconds
from volery.kernel.task import Cancelled, ExecutionContext
from volery.links.wire_faults import WireFaults
from volery.model.faults import (
    BatteryLow,
    Fault,
    GpsLost,
    LinkCut,
    LinkDegraded,
    MotorDead,
    OtherStation,
    ProgramKilled,
    VehicleFault,
    WindChange,
)
from volery.run.assembly.fault_effects import NO_WIRE_FAULTS, Affected, apply_fault
from volery.simulation.world.body_specs import STANDARD_GRAVITY, BodySpec, Multirotor
from volery.testing.checks import CheckFailedError, demand
from volery.testing.driver_checks.manual_control_checks import fly_by_hand
from volery.testing.stage import SimulatedStage, TestStage
from volery.trace.events import VehicleState
from volery.vehicles import Drone
from volery.vehicles.address import parse

F = TypeVar("F", bound=Fault)


def _trial(kind: type[F], seconds: float | None = None, **arguments: Any) -> F:
    """Return a fault that happens when the trial is ready for it, to the vehicle of the trial."""
    if issubclass(kind, VehicleFault):
        arguments["vehicle"] = ""
    return kind(at_ns=0, duration_ns=None if seconds is None else from_seconds(seconds), **arguments)


def lean_in_wind(spec: Multirotor, speed_m_s: float) -> float:
    """Return the lean at which the thrust balances a wind's drag and the weight, deg: atan(D / m g)."""
    drag = (spec.drag_linear + spec.drag_quadratic * speed_m_s) * speed_m_s
    return degrees(atan2(drag, spec.mass * STANDARD_GRAVITY))


LEAST_TILT_DEG = 30.0
"""Largest tilt that every simulated autopilot allows itself, deg."""
STRONG_WIND_M_S = next(
    half / 2.0 - 1.0 for half in count(2) if lean_in_wind(Multirotor(), half / 2.0 + 0.5) > LEAST_TILT_DEG
)
"""The strongest wind against which this airframe still makes way, by 1 m/s, in steps of 0.5 m/s."""

FAULTS: Mapping[str, Fault | None] = {
    "none": None,
    "cut-0.5": _trial(LinkCut, 0.5),
    "cut-2": _trial(LinkCut, 2.0),
    "cut-10": _trial(LinkCut, 10.0),
    "duplicated": _trial(LinkDegraded, duplicate=1.0),
    "reordered": _trial(LinkDegraded, reorder=0.3),
    "corrupted": _trial(LinkDegraded, corrupt=0.01),
    "truncated": _trial(LinkDegraded, truncate=0.2),
    "other-station": _trial(OtherStation),
    "killed": _trial(ProgramKilled),
    "battery-low": _trial(BatteryLow, charge=0.08),
    "gps-lost": _trial(GpsLost),
    "motor-weak": _trial(MotorDead, thrust=0.7),
    "wind": _trial(WindChange, speed_m_s=STRONG_WIND_M_S, direction_deg=270.0, gusts_m_s=1.5),
}
"""From 8 % this airframe hovers for 34 s."""


@dataclass
class _StageLinks:
    """Control of the link of the program under test."""

    stage: SimulatedStage

    def cut(self, vehicle: str, active: bool) -> None:
        """See ``volery.run.assembly.fault_effects.LinkControl``."""
        if active:
            self.stage.link_control.drop()
        else:
            self.stage.link_control.restore()

    def set_faults(self, vehicle: str, faults: WireFaults) -> None:
        """See ``volery.run.assembly.fault_effects.LinkControl``."""
        self.stage.set_faults(faults)


def strike(fault: Fault | None, stage: SimulatedStage) -> None:
    """Make a fault of a trial happen now, to the vehicle of *stage*; it ends after its duration, if any."""
    if fault is None:
        return
    if isinstance(fault, ProgramKilled):  # as a killed process: the link is silent
        stage.link_control.drop()
        return
    if isinstance(fault, OtherStation):
        other = stage.other()
        if stage.driver.telemetry.flying:
            other.land()
        else:
            other.disarm()
        return
    if isinstance(fault, VehicleFault):
        fault = replace(fault, vehicle=stage.name_of_vehicle)
    affected = Affected(stage.kernel, stage.fleet, _StageLinks(stage))
    apply_fault(fault, affected)
    if fault.duration_ns is not None:
        ending = fault
        stage.later(to_seconds(fault.duration_ns), lambda: apply_fault(ending, affected, active=False))


Strike = Callable[[], None]
Program = Callable[[TestStage, Strike], None]

AT_ONCE_S = 0.01
DURING_S = 3.0
"""Time after the beginning of the call, s."""


def ground(stage: TestStage, strike: Strike) -> None:
    """Arm on the ground, strike, then disarm."""
    stage.drone.wait_ready()
    stage.drone.hold()
    stage.drone.arm()
    strike()
    stage.sleep(1.0)
    stage.drone.disarm()


def arming(stage: TestStage, strike: Strike) -> None:
    """Strike at the beginning of the take-off, while its commands are in transit."""
    stage.drone.wait_ready()
    stage.later(AT_ONCE_S, strike)
    stage.drone.takeoff(15)


def takeoff(stage: TestStage, strike: Strike) -> None:
    """Strike during the climb."""
    stage.drone.wait_ready()
    stage.later(2 * DURING_S, strike)
    stage.drone.takeoff(15)


GOALS: Mapping[str, tuple[float, float, float]] = {
    "goto": (40.0, 10.0, 12.0),
    "hold": (15.0, 0.0, 10.0),
    "sticks": (10.0, 0.0, 10.0),
}
"""Where the last goto() of a phase goes: north, east, up about home [m]."""


def goto(stage: TestStage, strike: Strike) -> None:
    """Strike on the way to a position."""
    stage.drone.takeoff(10)
    stage.later(DURING_S, strike)
    stage.drone.goto(stage.at(*GOALS["goto"]))


def hold(stage: TestStage, strike: Strike) -> None:
    """Strike while holding position, wait, then continue with goto()."""
    stage.drone.takeoff(10)
    stage.drone.hold()
    strike()
    stage.sleep(12.0)
    stage.drone.goto(stage.at(*GOALS["hold"]))


def return_home(stage: TestStage, strike: Strike) -> None:
    """Strike at the beginning of the return home."""
    stage.drone.takeoff(10)
    stage.drone.goto(stage.at(20, 20, 10))
    stage.later(AT_ONCE_S, strike)
    stage.drone.return_home()


def land(stage: TestStage, strike: Strike) -> None:
    """Strike during the descent."""
    stage.drone.takeoff(10)
    stage.later(DURING_S, strike)
    stage.drone.land()


def sticks(stage: TestStage, strike: Strike) -> None:
    """Strike during manual control, then continue with goto()."""
    stage.drone.takeoff(10)
    stage.drone.manual_control(0.0, 0.0, 0.5, 0.0)
    stage.drone.altitude_hold()
    fly_by_hand(stage, 2.0, 0.5)
    strike()
    fly_by_hand(stage, 12.0, 0.5)
    stage.drone.goto(stage.at(*GOALS["sticks"]))


PHASES: Mapping[str, Program] = {
    "ground": ground,
    "arming": arming,
    "take-off": takeoff,
    "goto": goto,
    "hold": hold,
    "return": return_home,
    "land": land,
    "sticks": sticks,
}


LONGEST: Ns = 4 * MINUTE
"""Time after which a call is taken as hanging, s; the time-outs of these short flights are shorter."""

WATCHED: Ns = 100 * MS
LOST_S = 30.0
"""Time between the death of a program and the start of the next one, s."""
DOWN_WITHIN_S = 300.0

NEAR_M = 5.0
"""Largest distance from the goal, by truth, at which an operation may return."""
CLOSE_M, STANDING_M = 1.2, 0.3
"""Heights above ground: the last approach, and a vehicle that stands on its legs."""
BREAKS_M_S, UPRIGHT_DEG = 3.0, 20.0
"""Sink rate and lean at touch-down from which an airframe counts as damaged in still air."""
GUSTS_COVERED = 2.0
"""Standard deviations of the gusts that a vehicle may lean against."""


def most_lean(spec: BodySpec, fault: Fault | None) -> float:
    """Return the lean at touch-down from which an airframe counts as damaged, deg.

    A vehicle that stands still in wind must lean against its drag, down to the ground. Nothing is added to
    that lean but the gusts of two standard deviations.
    """
    if not isinstance(fault, WindChange) or not isinstance(spec, Multirotor):
        return UPRIGHT_DEG
    return max(UPRIGHT_DEG, lean_in_wind(spec, fault.speed_m_s + GUSTS_COVERED * fault.gusts_m_s))


def lean(state: VehicleState) -> float:
    """Return the angle between a vehicle's vertical axis and the plumb line [deg]."""
    cosine = 1.0 - 2.0 * (state.qx * state.qx + state.qy * state.qy)
    return degrees(acos(max(-1.0, min(1.0, cosine))))


@dataclass(frozen=True)
class TouchDown:
    """How a vehicle came to the ground, by truth.

    Attributes:
        sink_m_s: Largest sink rate on the last metre.
        lean_deg: Largest lean on the last metre.
        away_m: Distance from home.
        battery: Share of the battery that is left.
    """

    sink_m_s: float
    lean_deg: float
    away_m: float
    battery: float


def touch_down(states: Sequence[VehicleState]) -> TouchDown | None:
    """Return the last touch-down among samples of a flight; ``None`` if the vehicle has not flown."""
    landed = next(
        (
            place
            for place in range(len(states) - 1, 0, -1)
            if states[place].z <= STANDING_M < states[place - 1].z
        ),
        None,
    )
    if landed is None:
        return None
    first = landed - 1
    while first > 0 and STANDING_M < states[first - 1].z <= CLOSE_M:
        first -= 1
    last_metre, ground = states[first:landed], states[landed]
    return TouchDown(
        max(-state.vz for state in last_metre),
        max(lean(state) for state in last_metre),
        hypot(ground.x, ground.y),
        ground.battery,
    )


@dataclass
class Seen:
    """The aircraft's modes in order, and how often it was armed, from the fault on."""

    modes: list[str] = field(default_factory=list)
    armed: list[bool] = field(default_factory=list)
    states: list[VehicleState] = field(default_factory=list)

    def note(self, state: VehicleState) -> None:
        """Sample the aircraft's state."""
        self.states.append(state)
        if not self.modes or self.modes[-1] != state.mode:
            self.modes.append(state.mode)
        if not self.armed or self.armed[-1] != state.armed:
            self.armed.append(state.armed)

    @property
    def armings(self) -> int:
        """Number of changes from disarmed to armed."""
        return sum(later and not earlier for earlier, later in pairwise(self.armed))


@dataclass(frozen=True)
class Trial:
    """Result of one fault in one phase.

    Attributes:
        caller: ``done``, or the name of the error of the call.
        said: Text of that error.
        aircraft: Modes of the aircraft from the fault on.
        landing: How it came to the ground; ``None`` if it has not flown.
        broken: The demand that was not met; empty if all were.
    """

    autopilot: str
    fault: str
    phase: str
    caller: str
    said: str
    aircraft: tuple[str, ...]
    ended: str
    landing: TouchDown | None
    broken: str = ""


def try_fault(autopilot: str, fault: str, phase: str, seed: int = 1) -> Trial:
    """Run one trial of a simulated autopilot, through encoded frames if it has a link."""
    return _Trying(autopilot, fault, phase, seed).result()


class _Trying:
    """A trial in progress."""

    def __init__(self, autopilot: str, fault: str, phase: str, seed: int) -> None:
        self._names = autopilot, fault, phase
        self._fault = FAULTS[fault]
        self._killed = isinstance(self._fault, ProgramKilled)
        self._taken_over = isinstance(self._fault, OtherStation)
        self._program = PHASES[phase]
        self._stage = SimulatedStage(parse(f"sim:{autopilot}?wire=bytes"), Drone, seed)
        self._name = self._stage.name_of_vehicle
        self._seen = Seen()
        self._after = Seen()  # from the fault on
        self._struck = False
        self._caller, self._said = "", ""
        self._ended = ""
        self._scope = self._stage.kernel.root.child("program")

    def result(self) -> Trial:
        """Fly the phase and check the demands."""
        stage = self._stage
        stage.kernel.every(WATCHED, self._look)
        broken = ""
        try:
            self._fly()
            self._judge_caller()
            demand(self._struck, "the fault never came: the call was over before")
            stage.perform(self._bring_down)
            self._judge_aircraft()
        except CheckFailedError as error:
            broken = str(error)
        except TimeoutError as error:
            broken = str(error)
        finally:
            stage.close()
        landing = touch_down(self._seen.states)
        modes = tuple(self._after.modes)
        return Trial(*self._names, self._caller, self._said, modes, self._ended, landing, broken)

    def _look(self) -> None:
        state = self._stage.fleet.autopilots[self._name].state()
        self._seen.note(state)
        if self._struck:
            self._after.note(state)

    # -- the flight

    def _fly(self) -> None:
        kernel = self._stage.kernel
        kernel.spawn(self._call, "program", ExecutionContext("program"), self._scope)
        while not self._caller:
            demand(kernel.now() < LONGEST, "it hangs")
            kernel.run(kernel.now() + S)

    def _call(self) -> None:
        try:
            self._stage.drone.wait_connected()
            self._program(self._stage, self._strike)
            self._caller = "done"
        except VoleryError as error:
            self._caller, self._said = type(error).__name__, str(error)
        except Cancelled:
            self._caller = "killed"
            raise
        except Exception as error:  # an error of volery, reported as such
            self._caller, self._said = f"a fault of volery: {type(error).__name__}", str(error)

    def _strike(self) -> None:
        kernel = self._stage.kernel
        self._struck = True
        self._look()
        if self._killed:
            strike(self._fault, self._stage)
            kernel.call_at(kernel.now(), partial(kernel.cancel, self._scope, "killed"))
            return
        kernel.spawn(self._begin, "fate", ExecutionContext("fate"))

    def _begin(self) -> None:
        try:
            strike(self._fault, self._stage)
        except VoleryError:
            return  # the other station's refusals are its own concern

    # -- judgement

    def _judge_caller(self) -> None:
        if self._caller in {"done", "killed"}:
            return
        demand(not self._caller.startswith("a fault"), f"{self._caller}: {self._said}")
        demand(self._name in self._said, f"{self._caller} does not name the vehicle: {self._said}")

    def _bring_down(self) -> None:
        stage = self._stage
        if self._caller == "done":
            self._demand_done()
        stage.set_faults(NO_WIRE_FAULTS)
        program = stage.drone
        if self._killed:
            stage.sleep(LOST_S)
            program = stage.another_program()
            program.wait_connected()
        try:
            self._ended = program.come_to_rest()
        except VoleryError as error:
            self._ended = f"{type(error).__name__} at the end of the program"
        waited = 0.0
        while self._seen.armed[-1] and waited < DOWN_WITHIN_S:
            stage.sleep(1.0)
            waited += 1.0

    def _demand_done(self) -> None:
        """Demand that a completed operation is complete by the vehicle's true state."""
        state, phase = self._seen.states[-1], self._names[2]
        if phase == "ground":
            demand(not state.armed, "disarm() returned, and it is armed")
        elif phase in {"arming", "take-off"}:
            demand(state.z > 12.0, f"takeoff(15) returned at {state.z:.1f} m")
        elif phase in {"return", "land"}:
            demand(not state.armed and state.z < 1.0, f"it returned at {state.z:.1f} m, armed: {state.armed}")
        else:
            demand(state.armed, f"goto() returned disarmed at {state.z:.1f} m")
        north, east, up = GOALS.get(phase, (0.0, 0.0, state.z))
        off = dist((state.x, state.y, state.z), (east, north, up))
        demand(phase == "land" or off <= NEAR_M, f"{phase} returned {off:.1f} m off")

    def _judge_aircraft(self) -> None:
        demand(not self._seen.armed[-1], f"it is still armed in {self._seen.modes[-1]} ({self._ended})")
        demand(self._seen.armings <= 1 or self._taken_over, f"it was armed {self._seen.armings} times")
        off = next((state.z for state in self._seen.states if not state.armed and state.z > 1.0), 0.0)
        demand(off == 0.0, f"its motors were off at {off:.1f} m")
        landing = touch_down(self._seen.states)
        if landing is not None:
            demand(landing.sink_m_s < BREAKS_M_S, f"it touched down at {landing.sink_m_s:.1f} m/s")
            most = most_lean(self._stage.flight.spec, self._fault)
            demand(landing.lean_deg < most, f"it touched down leaning {landing.lean_deg:.0f} degrees")
            demand(landing.battery > 0.0, "its battery was empty at touch-down")
        if self._taken_over:
            self._demand_not_fought()

    def _demand_not_fought(self) -> None:
        """Demand that no own mode follows the other station's in flight while the vehicle is armed."""
        start = self._after.modes[0]
        theirs = next(
            (mode for mode in self._after.modes[1:] if mode in self._stage.driver.landing_modes), ""
        )
        if not theirs or not self._after.armed[0]:
            return
        rest = [state.mode for state in self._after.states if state.armed]
        behind = rest[rest.index(theirs) :] if theirs in rest else []
        demand(
            start == theirs or start not in behind, f"its mode was fought: {' > '.join(self._after.modes)}"
        )
