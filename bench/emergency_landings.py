"""Emergency landings of a simulated ArduCopter: each way to fly, in each phase, over each link.

The safety switch is moved to its landing position at the start of the motors, in the climb, in a turn, on the
way between way points, and in the descent; over a good link, over 57600 baud with loss, and with the link cut
with the switch or later. Once LAND was sent the autopilot needs no link, and all its parameters are default
ones. With the link cut before, the program cannot land, and the autopilot does by its own failsafe
(FS_GCS_ENABLE=5) or by its own switch (RC6_OPTION=18). Each row must end on the ground, disarmed, with less
than 1 m/s at touch-down. Arguments name the phases to fly; by default all.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from math import hypot, inf
from typing import NamedTuple

from volery.base.errors import LinkLost
from volery.base.time import MS, Ns, S, from_seconds
from volery.control.flight import ControlledFlight
from volery.control.manoeuvres import Altitude, LawManoeuvre, Rotation, Waypoints
from volery.control.safety_switch import SwitchSettings
from volery.kernel.waiting import sleep
from volery.run.assembly.vehicles import VehicleSettings, open_vehicles
from volery.run.go import ACTUATIONS, WAYS
from volery.simulation.autopilots.autopilot import Autopilot
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

    make: Callable[[], LawManoeuvre]
    reached: Callable[[Seen], bool]


def _turns() -> LawManoeuvre:
    return Rotation([0.0, 90.0], 6.0)


PHASES: Mapping[str, Phase] = {
    "start of the motors": Phase(_turns, lambda seen: seen.armed_s > 0.3),
    "climb": Phase(_turns, lambda seen: seen.height > 2.0),
    "turn": Phase(_turns, lambda seen: seen.height > 3.5 and 30.0 < seen.heading < 80.0),
    "way points": Phase(lambda: Waypoints([(8.0, 0.0, 4.0), (8.0, 8.0, 6.0)]), lambda seen: seen.way > 3.0),
    "descent": Phase(lambda: Altitude([8.0, 3.0], 8.0), lambda seen: seen.highest - seen.height > 1.5),
}
FAILSAFE = "&parameters=FS_GCS_ENABLE:5,FS_OPTIONS:0,RC_OVERRIDE_TIME:1"


class Link(NamedTuple):
    """A link: options of the address, and when it is cut after the switch has moved, s; infinite: never."""

    options: str
    cut_after_s: float = inf


LINKS: Mapping[str, Link] = {
    "good": Link(""),
    "57600 baud, 2 % lost": Link("&wire=bytes&baud=57600&drop=0.02&flip=1e-5"),
    "lost 0.3 s later": Link("&wire=bytes", 0.3),
    "lost 5 s later": Link("&wire=bytes", 5.0),
    "lost with the switch": Link(f"&wire=bytes{FAILSAFE}", 0.0),
    "lost, RC6_OPTION=18": Link("&wire=bytes&parameters=RC6_OPTION:18", 0.0),
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


def landed(by: str, phase: Phase, link: Link, known: float) -> Landed:
    """Fly, move the switch in the phase, and return how it ended.

    Args:
        by: how commands are applied.
        phase: what is flown.
        link: the link.
        known: when the switch moves, s, where the link is cut and a flight before has shown it.
    """
    cut_at = known + link.cut_after_s
    options = link.options if cut_at == inf else f"{link.options}&cut={cut_at:.3f}-{LIMIT_S}"
    url = f"sim:{NAME}?start=warm&attitude=50&rate=20&rc=20{options}"
    opened = open_vehicles({NAME: url}, {NAME: Drone}, VehicleSettings())
    kernel, fleet, drone = opened.kernel, opened.fleet, opened.vehicles[0]
    assert fleet is not None
    assert isinstance(drone, Drone)
    autopilot, truth = fleet.autopilots[NAME], fleet.flights[NAME].truth
    assert isinstance(autopilot, Autopilot)
    vehicle, switch = autopilot.vehicle, autopilot.transmitter
    switch[SWITCH.channel - 1] = 1500
    moved = inf
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
            with nullcontext() if cut_at == inf else suppress(LinkLost):
                flight.run()
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
    for name in sys.argv[1:] or PHASES:
        phase = PHASES[name]
        for by in WAYS:
            at = 0.0
            for link, options in LINKS.items():
                found = landed(by, phase, options, at)
                at = at or found.moved
                wrong += not found.good
                note = "" if found.good else f"  WRONG: {found}"
                times = f"{found.speed:8.2f} m/s{found.seconds:14.1f} s"
                print(f"{name:22}{by:12}{link:24}{times}{note}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
