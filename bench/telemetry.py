"""What hearing a vehicle costs: CPU per message through link, driver, filter and wake-up.

Reference: pymavlink's own loop, ``for chunk in chunks: mav.parse_buffer(chunk)``, which stores nothing. Both
get the same bytes in the same chunks: five minutes of a simulated ArduPilot's telemetry at the driver's
default rates, where six messages of ten wake a task, and as a ground station asks for it (attitude and more
at 10 Hz). Rounds take turns; figures are medians.

Then 20 vehicles in one process on 20 UDP sockets, in real time: the share of a core.

    python bench/telemetry.py [--quick]
"""

from __future__ import annotations

import argparse
import gc
import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter, process_time, sleep

from pymavlink.dialects.v20 import ardupilotmega

from volery.base.position import Position
from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import WallKernel
from volery.links.mavlink_codec import MAVLINK
from volery.links.udp_link import UdpLink
from volery.links.wire_faults import FaultyLink
from volery.run.assembly.simulated_fleet import fleet_of
from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.testing.fuzzing import FuzzTarget
from volery.vehicles import Drone
from volery.vehicles.address import parse
from volery.vehicles.driver import drivers
from volery.vehicles.telemetry import Telemetry

TARGET, VEHICLES, SECONDS = 0.7, 20, 300
MORE = {"ATTITUDE": 30, "LOCAL_POSITION_NED": 32, "VFR_HUD": 74, "RAW_IMU": 27, "SERVO_OUTPUT_RAW": 36}

Chunks = list[tuple[int, bytes]]
"""When they arrived, and what."""


def telemetry(seconds: int, rate: int) -> Chunks:
    """What arrives of a simulated ArduPilot; *rate* of what a ground station asks for, 0 for nothing more."""
    kernel = VirtualKernel()
    wanted = parse_simulated(parse("sim:ardupilot?start=warm&wire=bytes"), "craft")
    link = fleet_of(kernel, [wanted], 1).link_for(wanted)
    assert isinstance(link, FaultyLink)
    chunks: Chunks = []
    arrived = link.arrived

    def noted(data: bytes) -> None:
        if chunks and chunks[-1][0] == kernel.now():
            chunks[-1] = kernel.now(), chunks[-1][1] + data
        else:
            chunks.append((kernel.now(), data))
        arrived(data)

    link.arrived = noted  # type: ignore[method-assign]
    open_driver = drivers.load("ardupilot").on_link
    assert open_driver is not None
    driver = open_driver(kernel, link, "craft", {"attitude": str(rate)} if rate else {})
    kernel.run(5 * S)
    services = driver.services
    assert services is not None

    def request() -> None:
        for number in MORE.values():
            services.command("stream more", "MAV_CMD_SET_MESSAGE_INTERVAL", number, 1e6 / rate)

    if rate:
        kernel.spawn(request, "ground station", ExecutionContext("ground station"))
    kernel.run(7 * S)
    chunks.clear()
    kernel.run((7 + seconds) * S)
    return [(when - 7 * S, data) for when, data in chunks]


def theirs(chunks: Chunks) -> Callable[[], int]:
    def run() -> int:
        mav = ardupilotmega.MAVLink(None)
        return sum(len(mav.parse_buffer(data) or ()) for _, data in chunks)

    return run


def _moved(seen: Telemetry, before: Position | None) -> bool:
    return seen.position is not before


def ours(chunks: Chunks) -> Callable[[], int]:
    """A task waits for each position, as a control loop does; time passes as it did when they arrived."""

    open_driver = drivers.load("ardupilot").on_link
    assert open_driver is not None

    def run() -> int:
        kernel = VirtualKernel()
        link = FuzzTarget(kernel, "link", MAVLINK)
        drone = Drone(kernel, "craft", open_driver(kernel, link, "craft", {"texts": "unrecorded"}))
        seen = drone.telemetry
        woken = [0]

        def follow() -> None:
            while True:
                seen.changed.wait_for(partial(_moved, seen, seen.position), 10 * S)
                woken[0] += 1

        kernel.spawn(follow, "follower", ExecutionContext("follower"))
        turn = iter(chunks)

        def arrive(data: bytes) -> None:
            link.arrived(data)
            when, following = next(turn, (0, b""))
            if following:
                kernel.call_at(when, partial(arrive, following))

        kernel.call_at(0, partial(arrive, b""))
        kernel.run(chunks[-1][0] + MS)
        assert woken[0] > 100
        return link.statistics.frames

    return run


def compare(what: str, chunks: Chunks, rounds: int) -> None:
    candidates = {"theirs": theirs(chunks), "ours": ours(chunks)}
    times: dict[str, list[float]] = {name: [] for name in candidates}
    counts: dict[str, int] = {}
    for _ in range(rounds + 1):
        for name, action in candidates.items():
            gc.collect()
            start = process_time()
            counts[name] = action()
            times[name].append(process_time() - start)
    assert counts["theirs"] == counts["ours"], counts
    reference, taken = (median(times[name][1:]) for name in ("theirs", "ours"))
    each, theirs_each = (1e6 * one / counts["ours"] for one in (taken, reference))
    print(
        f"{what}: {counts['ours']} messages in {len(chunks)} chunks: {each:5.1f} us a message, parse_buffer "
        f"{theirs_each:5.1f} us: {reference / taken:4.2f} x its speed (target {TARGET})"
    )


# -- many vehicles


def replay(chunks: Chunks, ports: list[int]) -> None:
    """To all of them at once, over and over, until the process is ended."""
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    began, turn = perf_counter(), 0
    while True:
        when, data = chunks[turn % len(chunks)]
        wait = when / S + SECONDS * (turn // len(chunks)) - (perf_counter() - began)
        if wait > 0:
            sleep(wait)
        for port in ports:
            sender.sendto(data, ("127.0.0.1", port))
        turn += 1


def many(chunks: Chunks, seconds: float) -> None:
    kernel = WallKernel()
    open_driver = drivers.load("ardupilot").on_link
    assert open_driver is not None
    links = [UdpLink(kernel, "127.0.0.1", 0) for _ in range(VEHICLES)]
    drones = [
        Drone(kernel, f"craft_{number}", open_driver(kernel, link, f"craft_{number}", {}))
        for number, link in enumerate(links)
    ]
    kernel.start()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "chunks"
        file.write_text("\n".join(f"{when} {data.hex()}" for when, data in chunks))
        ports = ",".join(str(link.port) for link in links)
        child = subprocess.Popen([sys.executable, __file__, "--replay", str(file), "--ports", ports])
        while not all(drone.telemetry.last_message_ns >= 0 for drone in drones):
            sleep(0.1)
        frames = sum(link.statistics.frames for link in links)
        start, began = process_time(), perf_counter()
        sleep(seconds)
        share = (process_time() - start) / (perf_counter() - began)
        frames = sum(link.statistics.frames for link in links) - frames
        child.terminate()
        child.wait()
    for drone in drones:
        drone.close()
    kernel.close()
    print(
        f"{VEHICLES} vehicles on UDP sockets at default rates: {frames / seconds:.0f} messages/s, "
        f"{share:.1%} of a core"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one short round")
    parser.add_argument("--replay", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--ports", default="", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.replay:
        lines = (line.split() for line in options.replay.read_text().splitlines())
        chunks = [(int(when), bytes.fromhex(data)) for when, data in lines]
        replay(chunks, [int(port) for port in options.ports.split(",")])
    default = telemetry(SECONDS, 0)
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    rounds = 1 if options.quick else 9
    compare("default rates", default, rounds)
    compare("as a ground station", telemetry(SECONDS, 10), rounds)
    os.sched_setaffinity(0, cores)
    many(default, 4.0 if options.quick else 20.0)


if __name__ == "__main__":
    main()
