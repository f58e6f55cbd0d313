"""Faults of the world in each phase of a flight: what real firmware does, and what the simulated one does.

    python bench/firmware_faults.py PROJECT[=PROGRAM] ... [--faults NAME,...] [--phases NAME,...] [--missing]

Each fault strikes in each phase on the program of the project's real firmware and on the simulated autopilot
of the same name, as both are by default, and lasts. The operation of the phase goes on, and no monitor of the
flying API intervenes: what the vehicle does is the firmware's own doing. Writes
docs/reference/firmware-faults.json, from which scripts/generate_docs.py makes a page; flights that are not
asked for stay as they are, with ``--missing`` those that are there, too. All take half an hour for a project.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from itertools import product
from math import hypot
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from volery.base.errors import VoleryError
from volery.base.position import Position
from volery.base.time import MS, S, from_seconds, to_seconds
from volery.kernel.task import ExecutionContext
from volery.model.faults import (
    BarometerStuck,
    BatteryCellDead,
    BatteryLow,
    CompassStuck,
    CompassTurned,
    Fault,
    GpsDrift,
    GpsLost,
    ImuBiased,
    ImuNoisy,
    LinkCut,
    LinkDegraded,
    MotorDead,
    RcLost,
    VehicleFault,
    WindChange,
)
from volery.simulation.real_firmware.lock_step import RealFirmware
from volery.testing.fault_trials import (
    BREAKS_M_S,
    STRONG_WIND_M_S,
    lean,
    most_lean,
    strike,
    touch_down,
)
from volery.testing.stage import SimulatedStage
from volery.trace.events import Text, VehicleState
from volery.vehicles import Drone
from volery.vehicles.address import parse
from volery.vehicles.driver import Step
from volery.vehicles.executor import StepExecutor

KEPT = Path(__file__).parent.parent / "docs" / "reference" / "firmware-faults.json"
WINDOW_S = 45.0
"""Time that is watched from the fault on."""
LOOKED_AT = 100 * MS
WITHIN = 300 * S
TUMBLES_DEG = 70.0
ALOFT_M = 1.0
JOBS = 2


def _of(kind: type[Fault], **arguments: Any) -> Fault:
    """Return a fault for good, of the vehicle of the flight."""
    if issubclass(kind, VehicleFault):
        arguments["vehicle"] = ""
    return kind(at_ns=0, **arguments)


FAULTS: Mapping[str, Fault | None] = {
    "none": None,
    "gps-lost": _of(GpsLost),
    "gps-drift": _of(GpsDrift, speed_m_s=1.0),
    "barometer-stuck": _of(BarometerStuck),
    "compass-stuck": _of(CompassStuck),
    "compass-turned": _of(CompassTurned),
    "imu-biased": _of(ImuBiased),
    "imu-noisy": _of(ImuNoisy),
    "rc-lost": _of(RcLost),
    "battery-low": _of(BatteryLow, charge=0.08),
    "battery-cell-dead": _of(BatteryCellDead),
    "motor-dead": _of(MotorDead),
    "motor-weak": _of(MotorDead, thrust=0.7),
    "link-cut": _of(LinkCut),
    "link-degraded": _of(LinkDegraded, loss=0.5, delay_ns=S),
    "wind": _of(WindChange, speed_m_s=STRONG_WIND_M_S),
}


class Flight:
    """One flight in progress."""

    def __init__(self, url: str, fault: str, seed: int) -> None:
        self.stage = SimulatedStage(parse(url), Drone, seed)
        self.fault = FAULTS[fault]
        self.states: list[VehicleState] = []
        self.struck: VehicleState | None = None
        self.calls: list[str] = []
        self._executor = StepExecutor(self.stage.kernel, self.stage.driver)
        self._due: Callable[[VehicleState], bool] = lambda state: False
        self.stage.kernel.every(LOOKED_AT, self._look)

    def state(self) -> VehicleState:
        """Return the present state."""
        return self.stage.fleet.autopilots[self.stage.name_of_vehicle].state()

    def _look(self) -> None:
        state = self.state()
        if self.struck is None and self._due(state):
            self.strike()
        if self.struck is not None:
            self.states.append(state)

    def strike(self) -> None:
        """Let the fault happen now."""
        self.struck = self.state()
        strike(self.fault, self.stage)

    def strike_when(self, due: Callable[[VehicleState], bool]) -> None:
        """Let the fault happen when the state is as *due* says."""
        self._due = due

    def operate(self, name: str, plan: Callable[[], Sequence[Step]]) -> None:
        """Perform an operation without the monitors of the flying API; note what came of it."""
        try:
            self._executor.execute(name, plan)
        except VoleryError as error:
            self.calls.append(f"{type(error).__name__}: {error}")

    def takeoff(self, height: float) -> None:
        """Take off to *height* metres above home."""
        self.operate("take off", lambda: self.stage.driver.takeoff(height, WITHIN))

    def goto(self, place: Position) -> None:
        """Go to a place."""
        self.operate("go", lambda: self.stage.driver.goto(place, None, WITHIN))

    def land(self) -> None:
        """Land."""
        self.operate("land", lambda: self.stage.driver.land(WITHIN))


def ground(flight: Flight) -> None:
    """Standing disarmed; 10 s later it is asked to take off."""
    flight.strike()
    flight.stage.sleep(10.0)
    flight.takeoff(10.0)


def takeoff(flight: Flight) -> None:
    """On the way up to 20 m, at 4 m."""
    flight.strike_when(lambda state: state.z > 4.0)
    flight.takeoff(20.0)


def hover(flight: Flight) -> None:
    """Holding its place at 10 m for 5 s."""
    flight.takeoff(10.0)
    flight.stage.sleep(5.0)
    flight.strike()


def cruise(flight: Flight) -> None:
    """On the way to a point 250 m to the north, after 20 m."""
    flight.takeoff(10.0)
    flight.strike_when(lambda state: state.y > 20.0)
    flight.goto(flight.stage.at(250.0, 0.0, 10.0))


def landing(flight: Flight) -> None:
    """On the way down from 10 m, at 7 m."""
    flight.takeoff(10.0)
    flight.strike_when(lambda state: state.z < 7.0)
    flight.land()


PHASES: Mapping[str, Callable[[Flight], None]] = {
    "ground": ground,
    "take-off": takeoff,
    "hover": hover,
    "cruise": cruise,
    "landing": landing,
}


@dataclass
class Outcome:
    """What was seen of a flight; times are from the fault on [s].

    Attributes:
        modes: Modes in order, each with the time from which it was in force.
        texts: What the firmware said: time, severity, text.
        call: What came of the operations, empty if they were done or went on.
        broken: How it came to harm; empty if it did not.
        down_s: When it stood disarmed after it had flown; None: not within the window.
        flown: Whether it was above 1 m.
        moved_m: Largest horizontal distance from where the fault struck.
        estimate_off_m: Largest distance between its estimate and the truth.
    """

    project: str
    real: bool
    fault: str
    phase: str
    version: str = ""
    modes: list[tuple[float, str]] = field(default_factory=list)
    texts: list[tuple[float, int, str]] = field(default_factory=list)
    call: str = ""
    broken: str = ""
    down_s: float | None = None
    flown: bool = False
    moved_m: float = 0.0
    estimate_off_m: float = 0.0


def fly(project: str, url: str, fault: str, phase: str) -> Outcome:
    """Fly one fault in one phase."""
    flight = Flight(url, fault, 1)
    stage = flight.stage
    outcome = Outcome(project, url.startswith("firmware:"), fault, phase)

    def body() -> None:
        stage.drone.wait_ready()
        PHASES[phase](flight)

    def over() -> bool:
        return stage.kernel.now() > (flight.struck.at + from_seconds(WINDOW_S) if flight.struck else WITHIN)

    try:
        stage.kernel.spawn(body, "flight", ExecutionContext("flight"))
        while not over():
            stage.kernel.run(stage.kernel.now() + S)
        autopilot = stage.fleet.autopilots[stage.name_of_vehicle]
        outcome.version = autopilot.version if isinstance(autopilot, RealFirmware) else ""
        if flight.struck is None:
            raise RuntimeError(f"{url}: {fault} in {phase}: the fault never came; {flight.calls}")
        _note(outcome, flight)
    finally:
        stage.close()
    return outcome


def _note(outcome: Outcome, flight: Flight) -> None:
    """Fill in what was seen."""
    assert flight.struck is not None
    start = flight.struck.at
    states = [state for state in flight.states if state.at <= start + from_seconds(WINDOW_S)]
    for state in states:
        if not outcome.modes or outcome.modes[-1][1] != state.mode:
            outcome.modes.append((_after(state.at, start), state.mode))
    for event in flight.stage.events:
        if isinstance(event, Text) and event.source == flight.stage.name_of_vehicle and event.at >= start:
            outcome.texts.append((_after(event.at, start), event.severity, event.text))
    outcome.call = "; ".join(flight.calls)
    outcome.flown = any(state.z > ALOFT_M for state in states)
    was_aloft = False
    for state in states:
        was_aloft = was_aloft or state.z > ALOFT_M
        if was_aloft and not state.armed:
            outcome.down_s = _after(state.at, start)
            break
    outcome.broken = _harm(flight, states)
    outcome.moved_m = max(hypot(one.x - flight.struck.x, one.y - flight.struck.y) for one in states)
    outcome.estimate_off_m = max(
        hypot(one.x - one.estimated_x, one.y - one.estimated_y, one.z - one.estimated_z) for one in states
    )


def _harm(flight: Flight, states: Sequence[VehicleState]) -> str:
    assert flight.struck is not None
    for state in states:
        if lean(state) > TUMBLES_DEG:
            return f"tumbles after {_after(state.at, flight.struck.at):.0f} s"
        if not state.armed and state.z > ALOFT_M:
            return f"motors off at {state.z:.0f} m after {_after(state.at, flight.struck.at):.0f} s"
    landing = touch_down(states)
    if landing is not None and landing.sink_m_s >= BREAKS_M_S:
        return f"hits the ground at {landing.sink_m_s:.0f} m/s"
    if landing is not None and landing.lean_deg >= most_lean(flight.stage.flight.spec, flight.fault):
        return f"touches down leaning {landing.lean_deg:.0f} degrees"
    return ""


def _after(at: int, start: int) -> float:
    return round(to_seconds(at - start), 1)


def _row(outcome: Outcome) -> dict[str, Any]:
    row = asdict(outcome)
    row["moved_m"], row["estimate_off_m"] = round(outcome.moved_m, 1), round(outcome.estimate_off_m, 1)
    return row


def main() -> int:
    """Fly what is asked for and write the file."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("projects", nargs="+", metavar="PROJECT[=PROGRAM]")
    parser.add_argument("--faults", default=",".join(FAULTS))
    parser.add_argument("--phases", default=",".join(PHASES))
    parser.add_argument("--missing", action="store_true")
    asked = parser.parse_args()
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else []
    rows = {_key(row): row for row in kept}
    jobs = []
    with ProcessPoolExecutor(JOBS, mp_context=get_context("spawn")) as pool:
        for stated in asked.projects:
            project, _, program = stated.partition("=")
            real = f"firmware:{project}?wire=bytes&repeatable=1" + (f"&program={program}" if program else "")
            wanted = product(asked.phases.split(","), asked.faults.split(","), (False, True))
            for phase, fault, is_real in wanted:
                if not asked.missing or _key(asdict(Outcome(project, is_real, fault, phase))) not in rows:
                    url = real if is_real else f"sim:{project}?wire=bytes"
                    jobs.append(pool.submit(fly, project, url, fault, phase))
        failed = 0
        for job in jobs:
            try:
                row = _row(job.result())
            except (VoleryError, RuntimeError) as error:
                failed += 1
                print(error, file=sys.stderr, flush=True)
                continue
            rows[_key(row)] = row
            print(_summary(row), flush=True)
            ordered = sorted(rows.values(), key=_key)
            text = ",\n".join(json.dumps(one, ensure_ascii=False) for one in ordered)
            KEPT.write_text(f"[\n{text}\n]\n", encoding="utf-8")
    return 1 if failed else 0


def _key(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return (
        row["project"],
        [*PHASES].index(row["phase"]),
        [*FAULTS].index(row["fault"]),
        row["real"],
    )


def _summary(row: Mapping[str, Any]) -> str:
    what = row["broken"] or " > ".join(f"{mode} {at:g}" for at, mode in row["modes"])
    return (
        f"{'real' if row['real'] else 'simulated'} {row['project']} {row['phase']} {row['fault']}: {what},"
        f" down {row['down_s']}, moved {row['moved_m']}, off {row['estimate_off_m']}; {row['call'][:80]}"
    )


if __name__ == "__main__":
    sys.exit(main())
