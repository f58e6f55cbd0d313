"""Three simulated hours in the air, with all streams, trace and report: does memory grow?

Each vehicle has a process of its own, in virtual time. It is commanded by volery on one link, along
a square again and again, with 500 A h on board, and it logs. A second client, on a link of its own, asks for
every message that the autopilot can send, five times a second, or subscribes every topic of a DJI aircraft.
The run folder is written as by ``volery fly``. The aim is that the resident memory after three hours is at
most 1.1 times that after ten minutes.

    python bench/three_hours.py [--hours 3] [--out DIR] [VEHICLE ...]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

from volery.base.frames import LocalFrame
from volery.base.position import AboveHome, Position
from volery.base.time import S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.mavlink_messages import message_type
from volery.model.airframes import BatterySpec
from volery.run.assembly.simulated_fleet import SimulatedFleet, fleet_of
from volery.run.assembly.simulated_vehicles import SimulatedVehicle, parse_simulated
from volery.run.assembly.vehicle_nodes import PrivateGraph, open_simulated_driver, reached_over_links
from volery.run.recording import REPORT_FILE, Recording
from volery.simulation.autopilots.autopilot import Autopilot
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.trace.attachments import RunSetup, VehicleSetup
from volery.trace.mcap_writer import TRACE_FILE
from volery.vehicles import Drone, Rover
from volery.vehicles.address import parse

VEHICLES = ("ardupilot", "ardupilot-rover", "px4", "px4-rover", "paparazzi", "dji")
CAPACITY_AH = 500.0
EARLY_S = 600.0
AIM = 1.1
SIDE_M, HEIGHT_M = 40.0, 10.0
SEED = 1
STATION = (255, 190)
HEARTBEAT = {"type": 6, "autopilot": 8}
SET_MESSAGE_INTERVAL, INTERVAL_US = 511, 200_000.0


def resident_mb() -> float:
    """Return the resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


class Client:
    """A second client, which wants everything that the vehicle sends."""

    def __init__(self) -> None:
        self.received = 0

    def take(self, _message: object) -> None:
        """Count a message."""
        self.received += 1

    def on_link(self, kernel: VirtualKernel, fleet: SimulatedFleet, name: str) -> None:
        """Join on a link; a MAVLink autopilot is asked for all messages, Paparazzi sends them unasked."""
        link, autopilot = fleet.link(name), fleet.autopilots[name]
        link.receive(self.take)
        if not (isinstance(autopilot, Autopilot) and isinstance(autopilot.endpoint, MavlinkEndpoint)):
            return
        asked = iter(autopilot.endpoint.firmware.telemetry.messages)

        def beat() -> None:
            link.send(Frame("HEARTBEAT", HEARTBEAT, *STATION))
            wanted = next(asked, None)
            if wanted is not None:
                values = {"param1": message_type(wanted).id, "param2": INTERVAL_US}
                target = {"target_system": 1, "target_component": 1, "command": SET_MESSAGE_INTERVAL}
                link.send(Frame("COMMAND_LONG", {**target, **values}, *STATION))

        kernel.every(S, beat)

    def on_graph(self, served: PrivateGraph) -> None:
        """Subscribe every topic."""
        node = served.graph.node("client", context=ExecutionContext("client"))
        group = node.group(lambda work: work.run())
        for topic in served.graph.topics():
            if topic.publishers:
                node.subscribe(topic.name, topic.type, self.take, group=group)


def corners(home: LocalFrame) -> list[Position]:
    """Return the corners of a square beside home."""
    places = ((0.0, SIDE_M), (SIDE_M, SIDE_M), (SIDE_M, 0.0), (0.0, 0.0))
    found = (home.from_enu((east, north, 0.0)) for east, north in places)
    return [Position(latitude, longitude, AboveHome(HEIGHT_M)) for latitude, longitude, _ in found]


def tour(vehicle: Drone | Rover, goals: list[Position], until: int, kernel: VirtualKernel) -> None:
    """Fly or drive along the square until a time is reached."""
    vehicle.wait_ready()
    if isinstance(vehicle, Drone):
        vehicle.takeoff(HEIGHT_M)
    while kernel.now() < until:
        for goal in goals:
            if isinstance(vehicle, Drone):
                vehicle.goto(goal)
            else:
                vehicle.drive(goal)


def described(name: str) -> SimulatedVehicle:
    """Return a vehicle of the table with its battery."""
    autopilot, _, kind = name.partition("-")
    wanted = parse_simulated(parse(f"sim:{autopilot}?start=warm&kind={kind or 'multirotor'}"), autopilot)
    return replace(wanted, vehicle=replace(wanted.vehicle, battery=BatterySpec(CAPACITY_AH * 3600.0)))


def measure(name: str, hours: float, out: Path) -> str:
    """Fly one vehicle, and return its row of the table."""
    start = time.monotonic()
    wanted = described(name)
    own = wanted.vehicle.name
    kernel, client = VirtualKernel(), Client()
    fleet = fleet_of(kernel, [wanted], SEED)
    setup = RunSetup("three hours", seed=SEED, vehicles=(VehicleSetup(own, own, wanted.vehicle.kind),))
    recording = Recording(setup, out / name)
    kernel.record = recording.stream
    fleet.sample()
    if reached_over_links(fleet, wanted):
        driver = open_simulated_driver(kernel, fleet, wanted, SEED)
        client.on_link(kernel, fleet, own)
    else:
        served = PrivateGraph(kernel, fleet, wanted, SEED)
        driver = served.open()
        client.on_graph(served)
    vehicle = (Rover if wanted.vehicle.kind == "rover" else Drone)(kernel, own, driver)
    whole = round(hours * 3600.0 * S)
    task = partial(tour, vehicle, corners(wanted.frame), whole, kernel)
    kernel.spawn(task, "tour", ExecutionContext("tour"))
    kernel.run(round(EARLY_S * S))
    early = resident_mb()
    kernel.run(whole)
    late = resident_mb()
    armed = vehicle.armed
    recording.finish("completed", "its time is up", kernel.now(), ())
    sizes = [(out / name / file).stat().st_size / 1e6 for file in (TRACE_FILE, REPORT_FILE)]
    state = "armed" if armed else "NOT ARMED"
    return (
        f"{name:<16} {state:<9} {client.received:>9} {early:>8.1f} {late:>8.1f} {late / early:>6.3f}"
        f" {sizes[0]:>9.1f} {sizes[1]:>9.1f} {time.monotonic() - start:>7.0f}"
    )


def main() -> None:
    """Measure each vehicle in a process of its own and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("vehicles", nargs="*", default=VEHICLES, metavar="VEHICLE")
    parser.add_argument("--hours", type=float, default=3.0)
    parser.add_argument("--out", type=Path, help="folder of the run folders, which are kept")
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.alone:
        print(measure(chosen.vehicles[0], chosen.hours, chosen.out))
        return
    print(
        f"{'vehicle':<16} {'state':<9} {'messages':>9} {'10 min':>8} {chosen.hours:>6g} h {'ratio':>6}"
        f" {'trace MB':>9} {'report MB':>9} {'wall s':>7}"
    )
    with tempfile.TemporaryDirectory() as scratch:
        out = chosen.out or Path(scratch)
        for name in chosen.vehicles:
            command = [sys.executable, __file__, "--alone", "--hours", str(chosen.hours), "--out", str(out)]
            done = subprocess.run([*command, name], stdout=subprocess.PIPE, text=True, check=True)
            print(done.stdout, end="", flush=True)
            if float(done.stdout.rsplit(maxsplit=4)[1]) > AIM:
                print(f"  more than {AIM} times")


if __name__ == "__main__":
    main()
