"""Emergency landings of a simulated ArduCopter: each way to fly, in each phase, over each link.

The safety switch is moved to its landing position at the start of the motors, in the climb, in a turn, on the
way between way points, and in the descent; over a good link, over 57600 baud with loss, and with the link cut
when the switch moves. Then the program cannot land, and the autopilot does by its own failsafe
(FS_GCS_ENABLE=5). Each row must end on the ground, disarmed, with less than 1 m/s at touch-down.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from math import hypot, inf
from typing import NamedTuple

from volery.base.errors import LinkLost
from volery.base.time import MS, Ns, S, from_seconds
from volery.control.flight import ControlledFlight
from volery.control.manoeuvres import Altitude, Manoeuvre, Rotation, Waypoints
from volery.control.safety_switch import SwitchSettings
from volery.kernel.waiting import sleep
from volery.run.assembly.vehicles import VehicleSettings, open_vehicles
from volery.run.go import ACTUATIONS, WAYS
from volery.vehicles import Drone

NAME = "ardupilot"
SWITCH = SwitchSettings()
LOOK: Ns = 5 * MS
GREATEST = 1.0
"""Greatest speed at touch-down, m/s."""
LIMIT_S = 120.0
THROTTLE = 3


class Seen(NamedTuple):
    """One moment: time since the motors started in s, height and way in m, heading in degrees."""

    armed_s: float
    height: float
    highest: float
    way: float
    heading: float


class Phase(NamedTuple):
    """What is flown, and the moment at which the switch moves."""

    make: Callable[[], Manoeuvre]
    reached: Callable[[Seen], bool]


def _turns() -> Manoeuvre:
    return Rotation([0.0, 90.0], 6.0)


PHASES: Mapping[str, Phase] = {
    "start of the motors": Phase(_turns, lambda seen: seen.armed_s > 0.3),
    "climb": Phase(_turns, lambda seen: seen.height > 2.0),
    "turn": Phase(_turns, lambda seen: seen.height > 3.5 and 30.0 < seen.heading < 80.0),
    "way points": Phase(lambda: Waypoints([(8.0, 0.0, 4.0), (8.0, 8.0, 6.0)]), lambda seen: seen.way > 3.0),
    "descent": Phase(lambda: Altitude([8.0, 3.0], 8.0), lambda seen: seen.highest - seen.height > 1.5),
}
LINKS = {
    "good": "",
    "57600 baud, 2 % lost": "&wire=bytes&baud=57600&drop=0.02&flip=1e-5",
    "lost": "&wire=bytes&parameters=FS_GCS_ENABLE:5,FS_OPTIONS:0,RC_OVERRIDE_TIME:1",
}
"""By RC override the mode is a pilot's, in which FS_OPTIONS=16, the default, does not land."""


class Landed(NamedTuple):
    """How a flight ended.

    Attributes:
        armed: whether the motors run.
        height: height, m.
        speed: greatest rate of descent at the ground after the switch was moved, m/s.
        moved: time at which the switch was moved, s; infinite if the phase was not reached.
        seconds: time from then until the motors stopped, s.
    """

    armed: bool
    height: float
    speed: float
    moved: float
    seconds: float

    @property
    def good(self) -> bool:
        """Whether it stands, disarmed, and touched down gently."""
        return not self.armed and self.height < 0.3 and self.speed < GREATEST and self.moved < inf


def landed(by: str, phase: Phase, link: str, cut_at: float | None = None) -> Landed:
    """Fly, move the switch in the phase (or cut the link at a time in s), and return how it ended."""
    options = link if cut_at is None else f"{link}&cut={cut_at:.3f}-{LIMIT_S}"
    url = f"sim:{NAME}?start=warm&attitude=50&rate=20&rc=20{options}"
    opened = open_vehicles({NAME: url}, {NAME: Drone}, VehicleSettings())
    kernel, fleet, drone = opened.kernel, opened.fleet, opened.vehicles[0]
    assert fleet is not None
    assert isinstance(drone, Drone)
    vehicle, truth = fleet.autopilots[NAME].vehicle, fleet.flights[NAME].truth
    switch = vehicle.rc.transmitter
    switch[SWITCH.channel - 1] = 1500
    moved = inf if cut_at is None else cut_at
    armed_at = ended = speed = highest = 0.0

    def look() -> None:
        nonlocal armed_at, moved, speed, ended, highest
        body, now = truth(), kernel.now() / S
        height = body.position[2] - body.ground
        highest = max(highest, height)
        if height > 1.0:
            switch[THROTTLE - 1] = 1500  # where a pilot has it in altitude hold
        if not vehicle.armed:
            armed_at = now
        else:
            ended = now
        heading = drone.telemetry.attitude.heading
        seen = Seen(now - armed_at, height, highest, hypot(*body.position[:2]), heading)
        if moved == inf and vehicle.armed and phase.reached(seen):
            moved, switch[SWITCH.channel - 1] = now, 1900
        if height > 0.6:
            speed = 0.0
        elif height < 0.3 and now > moved:
            speed = max(speed, -body.velocity[2])

    kernel.every(LOOK, look)
    flight = ControlledFlight(drone, phase.make(), ACTUATIONS[by](drone), switch=SWITCH, height=4.0)
    try:
        with kernel.adopt("landings"):
            drone.wait_connected()
            try:
                flight.run()
            except LinkLost:
                if cut_at is None:
                    raise
            while vehicle.armed and kernel.now() < from_seconds(LIMIT_S):
                sleep(kernel, S)
            body = truth()
    finally:
        drone.close()
        opened.leave()
        kernel.close()
    height = body.position[2] - body.ground
    return Landed(vehicle.armed, height, speed, moved, ended - moved)


def main() -> int:
    """Print one row for each combination; return 1 if one is not good."""
    print(f"{'phase':22}{'commands':12}{'link':24}{'touch-down':>12}{'disarmed after':>16}")
    wrong = 0
    for name, phase in PHASES.items():
        for by in WAYS:
            at: float | None = None
            for link, options in LINKS.items():
                found = landed(by, phase, options, at if link == "lost" else None)
                at = found.moved if at is None else at
                wrong += not found.good
                note = "" if found.good else f"  WRONG: {found}"
                times = f"{found.speed:8.2f} m/s{found.seconds:14.1f} s"
                print(f"{name:22}{by:12}{link:24}{times}{note}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
