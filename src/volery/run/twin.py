"""``twin``: a vehicle follows a record or another vehicle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from volery.base.errors import UsageError
from volery.base.time import MS
from volery.components.loader import Loader
from volery.components.programs import load_function
from volery.control.actuation import VelocitySetpoints
from volery.control.digital_twin import (
    AIRBORNE,
    Follow,
    LiveReference,
    TrackingError,
    Twin,
    describe_judged,
    recorded_reference,
    tracking_errors,
)
from volery.control.flight import ControlledFlight
from volery.control.log_signals import read_signals
from volery.kernel.waiting import sleep
from volery.run.fly import FUNCTION, fly, names_of
from volery.run.go import with_rates
from volery.run.result import Options, Run
from volery.vehicles import Drone

WAIT = 100 * MS
HEIGHT = 3.0
"""Height to which a twin takes off before it joins its reference, m."""


class TwinRun(NamedTuple):
    """A run of a twin, its tracking errors, and what part of the flight they include, in words."""

    run: Run
    errors: list[TrackingError]
    judged: str = ""


def follow_record(record: Path, on: str, options: Options) -> TwinRun:
    """Let the vehicle at *on* fly what a record contains.

    Args:
        record: run folder, rosbag, tlog, DataFlash log or ULog with yaw and position.
        on: address of the twin.
        options: options of the run; its folder is needed for the errors.

    Raises:
        UsageError: the record contains no flight, or the address is wrong.
    """
    reference = recorded_reference(read_signals(record))
    first = reference(0.0)
    height = max(HEIGHT, first.up if first is not None else HEIGHT)

    def mission(drone: Drone) -> None:
        drone.wait_ready()
        _flight(drone, reference, height).run()

    return _judged(fly(mission, with_rates(on, None), options))


def follow_vehicle(leader: str, on: str, options: Options, mission: Path | None = None) -> TwinRun:
    """Let the vehicle at *on* follow the one at *leader* until that has landed.

    Both are simulated in one world, or both are real. The leader gets no command unless *mission* flies it:
    that begins once the twin is in the air. A leader that another program flies is awaited on the ground,
    until it arms.

    Args:
        leader: address of the vehicle that is followed.
        on: address of the twin.
        options: options of the run.
        mission: file with the mission of the leader.

    Raises:
        UsageError: an address or the mission is wrong.
    """
    lead: Callable[[Drone], object] | None = None
    if mission is not None:
        if not mission.is_file():
            raise UsageError(f"there is no file {mission}; a mission of the leader is expected")
        lead = load_function(Loader(), mission, FUNCTION)
    addresses = [with_rates(leader, None), with_rates(on, None)]
    names = list(names_of(addresses))
    drones: dict[str, Drone] = {}
    ended = False

    def flown(drone: Drone) -> None:
        nonlocal ended
        drones[drone.name] = drone
        _await(drone, lambda: len(drones) == len(names))
        ahead, twin = (drones[name] for name in names)
        if drone is ahead:
            _lead(drone, twin)
            ended = True
            return
        drone.wait_ready()
        _await(drone, lambda: ended or ahead.armed or lead is not None)
        _flight(drone, LiveReference(ahead, lambda: ended or not ahead.flying), HEIGHT).run()

    def _lead(drone: Drone, twin: Drone) -> None:
        if lead is not None:
            drone.wait_ready()
            _await(drone, lambda: twin.flying and twin.telemetry.above_home > AIRBORNE)
            lead(drone)
            return
        _await(drone, lambda: drone.flying)
        _await(drone, lambda: not drone.flying)

    return _judged(fly(flown, addresses, options))


def _await(drone: Drone, condition: Callable[[], bool]) -> None:
    while not condition():
        sleep(drone.kernel, WAIT)


def _flight(drone: Drone, reference: Follow, height: float) -> ControlledFlight:
    return ControlledFlight(drone, Twin(reference), VelocitySetpoints(drone), height=height)


def _judged(run: Run) -> TwinRun:
    if run.folder is None:
        return TwinRun(run, [])
    signals = read_signals(run.folder)
    return TwinRun(run, tracking_errors(signals), describe_judged(signals))
