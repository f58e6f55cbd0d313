"""Three simulated hours of each simulated autopilot, asked for all that it can send: does memory grow?

Each vehicle has a process of its own, in virtual time. A client on a link in the process asks for every
stream and uses all of it; a copter hovers and a rover drives with 200 A h on board, and logs. The simulated
Paparazzi and DJI, which send what they send without being asked, stand on the ground. The aim is that the
resident memory after three hours is at most 1.1 times that after ten minutes.

    python bench/three_hours.py [--hours 3] [VEHICLE ...]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from math import nan
from pathlib import Path

from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.mavlink_messages import message_type
from volery.ros.graph.embedded_graph import EmbeddedGraph
from volery.simulation.autopilots.autopilot import Autopilot, firmwares
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.simulation.world.body_specs import Battery, Multirotor, Rover

VEHICLES = ("ardupilot", "ardupilot-rover", "px4", "px4-rover", "paparazzi", "dji")
CAPACITY_AH = 200.0
EARLY_S = 600.0
AIM = 1.1
HOME_AMSL = 900.0
HOME = LocalFrame(46.0825, -103.8995, HOME_AMSL)
STATION = (255, 190)
HEARTBEAT = {"type": 6, "autopilot": 8}
SETTLED_S = 5.0


def resident_mb() -> float:
    """Return the resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


class Client:
    """A station that wants everything.

    Args:
        kernel: Clock.
        autopilot: The vehicle.
        codec: Protocol of its links.
    """

    def __init__(self, kernel: VirtualKernel, autopilot: Autopilot, codec: object) -> None:
        ours, theirs = in_process_pair(kernel, MS, "client", codec)  # type: ignore[arg-type]
        self._kernel, self._link = kernel, ours
        self.received = 0
        ours.receive(self._count)
        autopilot.connect(theirs)

    def _count(self, _frame: Frame) -> None:
        self.received += 1

    def send(self, name: str, fields: dict[str, object]) -> None:
        """Send a message as a ground station."""
        self._link.send(Frame(name, {"target_system": 1, "target_component": 1, **fields}, *STATION))

    def command(self, number: int, *params: float) -> None:
        """Send a COMMAND_LONG, and wait for a moment."""
        values = {f"param{place}": value for place, value in enumerate(params, start=1)}
        self.send("COMMAND_LONG", {"command": number, **values})
        self._kernel.run(self._kernel.now() + S // 5)

    def beat(self) -> None:
        """Send a heartbeat."""
        self._link.send(Frame("HEARTBEAT", HEARTBEAT, *STATION))


def ask_for_all(client: Client, autopilot: Autopilot) -> None:
    """Ask a MAVLink autopilot for all of its messages, five times a second."""
    endpoint = autopilot.endpoint
    assert isinstance(endpoint, MavlinkEndpoint)
    for name in endpoint.firmware.telemetry.messages:
        client.command(511, message_type(name).id, 200_000.0)


def fly(client: Client, autopilot: Autopilot) -> None:
    """Arm, and let a copter hover or a rover hold its place."""
    flies, vehicle = autopilot.vehicle.flies, autopilot.vehicle
    if autopilot.firmware.name == "ardupilot":
        client.command(176, 1, 4 if flies else 15)
        client.command(400, 1)
        if flies:
            client.command(22, 0, 0, 0, 0, 0, 0, 10)
    else:
        client.command(176, 1, 4, 3)
        client.command(400, 1)
        if flies:
            client.command(22, nan, nan, nan, nan, nan, nan, HOME_AMSL + 10.0)
    assert vehicle.armed, "it does not arm"


def measure(name: str, hours: float) -> tuple[float, float, int, bool]:
    """Return the memory after ten minutes and at the end [MB], what was received, and whether it is armed."""
    family_name, _, kind = name.partition("-")
    kernel, family = VirtualKernel(), firmwares.load(family_name)
    battery = replace(Battery(), capacity_ah=CAPACITY_AH)
    body = Rover(battery=battery) if kind else Multirotor(battery=battery)
    _, (flight,) = make_world(kernel.now, [body], seed=1, frame=HOME)
    autopilot = Autopilot(kernel, flight, family, warm=True, logging=True)
    received: Callable[[], int]
    if family.codec is None:
        autopilot.join(EmbeddedGraph(kernel), "/dji_1/dji_sdk", ExecutionContext(name))
        received = int
    else:
        client = Client(kernel, autopilot, family.codec)
        received = lambda: client.received  # noqa: E731
        if isinstance(autopilot.endpoint, MavlinkEndpoint):
            kernel.every(S, client.beat)
            kernel.run(round(SETTLED_S * S))
            ask_for_all(client, autopilot)
            fly(client, autopilot)
    kernel.run(round(EARLY_S * S))
    early = resident_mb()
    kernel.run(round(hours * 3600.0 * S))
    return early, resident_mb(), received(), autopilot.vehicle.armed


def main() -> None:
    """Measure each vehicle in a process of its own and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("vehicles", nargs="*", default=VEHICLES, metavar="VEHICLE")
    parser.add_argument("--hours", type=float, default=3.0)
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.alone:
        start = time.monotonic()
        early, late, received, armed = measure(chosen.vehicles[0], chosen.hours)
        state = "armed" if armed else "standing"
        print(
            f"{chosen.vehicles[0]:<16} {state:<9} {received:>9} {early:>8.1f} {late:>8.1f}"
            f" {late / early:>6.3f} {time.monotonic() - start:>7.0f}"
        )
        return
    print(
        f"{'vehicle':<16} {'state':<9} {'messages':>9} {'10 min':>8} {chosen.hours:>6g} h"
        f" {'ratio':>6} {'wall s':>7}"
    )
    for name in chosen.vehicles:
        command = [sys.executable, __file__, "--alone", "--hours", str(chosen.hours), name]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        print(done.stdout, end="", flush=True)
        if float(done.stdout.split()[5]) > AIM:
            print(f"  more than {AIM} times")


if __name__ == "__main__":
    main()
