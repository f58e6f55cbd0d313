"""``volery ros bridge`` beside a plain loop of pymavlink and rospy: their processor time, and their delays.

A source sends both the same MAVLink frames over UDP at the same instants: the 20 messages of all of
ArduPilot's streams, each at the rate, and heartbeats. Both publish roscopter's six topics of them on one
real roscore, and one listener hears all. The plain loop is what roscopter does, but blocks in
``recv_match`` instead of asking a thousand times a second; the loop that asks is measured as well.

Processor time is that of the process, from the kernel's clock of it. A delay is from just before the
source sends a RAW_IMU to the begin of the listener's callback.

    python bench/bridge.py [--seconds 20]
"""

from __future__ import annotations

import argparse
import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from volery.ros.transports.ros1 import Roscore
from volery.ros.transports.ros1.master import environment
from volery.ros.transports.ros1.rospy_copy import write_package

RATES_HZ = (10, 50)
SETTLE_S = 2.0
PEERS = Path(__file__).parent / "bridge_peers"
FRAMES, MESSAGES = 20, 5
"""Of a period; heartbeats and what becomes of them come on top."""
WAYS = ("volery", "blocking", "asking")
"""The bridge; a plain loop that waits for frames; one that asks a thousand times a second, as roscopter."""


def processor_seconds(process: subprocess.Popen[str]) -> float:
    """What the process has had of the processor so far, all its threads."""
    return time.clock_gettime((~process.pid << 3) | 2)


@contextmanager
def running(surroundings: dict[str, str], *arguments: object) -> Iterator[subprocess.Popen[str]]:
    """A Python program."""
    command = [sys.executable, *map(str, arguments)]
    process = subprocess.Popen(command, env=surroundings, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        asked.bind(("127.0.0.1", 0))
        return int(asked.getsockname()[1])


def measure(
    rate: int, seconds: float, surroundings: dict[str, str]
) -> dict[str, tuple[float, list[int], int]]:
    """Return for each way the share of a core, the delays and the number of messages."""
    ports = {way: free_port() for way in WAYS}
    script = "from volery.cli.main import main; main()"
    bridge = ("-c", script, "ros", "bridge", f"ardupilot+udp://:{ports['volery']}", "--rate", "0", "--quiet")
    named = ("--names", "roscopter", "--namespace", "/volery", "--enable-control")
    plain = [(PEERS / "plain.py", way, ports[way]) for way in WAYS[1:]]
    with (
        running(surroundings, *bridge, *named) as ours,
        running(surroundings, *plain[0]) as blocking,
        running(surroundings, *plain[1]) as asking,
        running(surroundings, PEERS / "listener.py", SETTLE_S, seconds, *WAYS) as listener,
        running(surroundings, PEERS / "source.py", rate, *ports.values()),
    ):
        processes = dict(zip(WAYS, (ours, blocking, asking), strict=True))
        assert listener.stdout is not None
        assert listener.stdout.readline() == "ready\n"
        before = {way: processor_seconds(process) for way, process in processes.items()}
        began = time.monotonic()
        received = json.loads(listener.stdout.readline())
        passed = time.monotonic() - began
        shares = {way: (processor_seconds(one) - before[way]) / passed for way, one in processes.items()}
    return {way: (shares[way], sorted(received["delays"][way]), received["received"][way]) for way in WAYS}


def show(rate: int, found: dict[str, tuple[float, list[int], int]]) -> None:
    print(f"{rate} Hz, {rate * FRAMES} frames/s, {rate * MESSAGES} messages/s")
    reference = found["blocking"][0]
    for way, (share, delays, received) in found.items():
        half, late = delays[len(delays) // 2], delays[len(delays) * 99 // 100]
        print(
            f"  {way:9} {share * 100:5.1f} % of a core, {share / reference:5.2f} x the blocking loop; "
            f"delay {half / 1000:5.2f} ms, p99 {late / 1000:5.2f} ms; {received} messages received"
        )
    added = found["volery"][1], found["blocking"][1]
    for name, place in (("median", 50), ("p99", 99)):
        ours, theirs = (delays[len(delays) * place // 100] for delays in added)
        print(f"  added by the bridge to the delay, {name}: {(ours - theirs) / 1000:+.2f} ms")


def main(seconds: float) -> None:
    port = free_port()
    with TemporaryDirectory() as folder, Roscore(f"http://127.0.0.1:{port}") as core:
        write_package("roscopter", Path(folder))
        surroundings = {**environment(core.uri), "PYTHONPATH": folder}
        for rate in RATES_HZ:
            show(rate, measure(rate, seconds, surroundings))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="how long each rate is measured")
    main(parser.parse_args().seconds)
