"""Real firmware in volery's world beside a bare loop over the same program: speed, shares of time, memory.

The bare loop answers each question of the firmware with the same samples, without a body, a battery, a kernel
or telemetry that anybody reads: no world can be faster. Both run in turn, on the same program, for the same
time of the firmware's clock. The goal is 0.8 of the bare loop's speed with one vehicle.

    VOLERY_ARDUCOPTER=... VOLERY_ARDUROVER=... VOLERY_PX4=... python bench/firmware.py [--fleet 4,2,4]

Programs that are not named are left out. The options of their builds are not known here; state them beside
the figures.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from types import SimpleNamespace
from typing import Any, NamedTuple

from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.in_process_link import in_process_pair
from volery.run.connect import SCRIPT
from volery.simulation.autopilots.flight_stack.flight import Flight, make_world
from volery.simulation.real_firmware.family import PROJECTS, RealFirmwareFamily
from volery.simulation.real_firmware.firmware_instance import Assignment, FirmwareInstance
from volery.simulation.real_firmware.lock_step import READ_EVERY, RealFirmware
from volery.simulation.real_firmware.px4 import CLOCK_START, SENSOR, ControlsReader
from volery.simulation.world.body_specs import BodySpec, Multirotor, WheeledRover
from volery.simulation.world.state_layout import M_ACCEL
from volery.vehicles import Drone
from volery.vehicles.driver import drivers

FRAME = LocalFrame(46.0825, -103.8995, 900.0)
BOOT = 2 * S
"""Time that the bare loop and the firmware's start take before the clock of the measurement begins."""


class Program(NamedTuple):
    """A firmware: the words for it, its project, its program, and the body that it moves."""

    words: str
    project: str
    path: Path
    spec: Callable[[], BodySpec]


def programs() -> list[Program]:
    """Return the programs that the environment names."""
    known = (
        ("ArduCopter", "ardupilot", "VOLERY_ARDUCOPTER", Multirotor),
        ("ArduRover", "ardupilot", "VOLERY_ARDUROVER", WheeledRover),
        ("PX4", "px4", "VOLERY_PX4", Multirotor),
    )
    return [
        Program(words, project, Path(os.environ[name]), spec)
        for words, project, name, spec in known
        if os.environ.get(name)
    ]


# -- the bare loop


def bare(program: Program, seconds: float) -> float:
    """Return the simulated seconds a second of a loop that answers with the same samples."""
    kernel = VirtualKernel()
    _, (flight,) = make_world(kernel.now, [program.spec()], seed=1, frame=FRAME)
    with TemporaryDirectory() as folder:
        instance = PROJECTS[program.project](
            Assignment("bare", flight, program.path, Path(folder) / "bare", {}, 1, repeatable=False)
        )
        try:
            return _same_samples(program.project, instance, flight, seconds)
        finally:
            instance.connection.close()
            instance.process.end()


def _same_samples(project: str, instance: FirmwareInstance, flight: Flight, seconds: float) -> float:
    exchange, row = instance.exchange, list(flight.row)
    period, clock = exchange.period, 0
    while clock < BOOT:  # the start script of PX4 answers nothing
        clock += period
        exchange.prepare(clock, row, 0.0)
        exchange.send()
        exchange.receive()
    answer = _datagrams(exchange, row) if project == "ardupilot" else _frames(exchange, row)
    readings = READ_EVERY // period
    count = int(seconds * S) // period
    begun = perf_counter()
    for number in range(count):
        clock += period
        answer(clock)
        if number % readings == 0:
            instance.connection.read()
    return seconds / (perf_counter() - begun)


def _datagrams(exchange: Any, row: list[float]) -> Callable[[int], None]:
    """Return what answers an ArduPilot: the text is made once."""
    port, sent = exchange._socket, []
    exchange._socket = SimpleNamespace(sendto=lambda octets, _: sent.append(octets))
    exchange.prepare(0, row, 0.0)
    exchange.send()
    exchange._socket = port
    head, tail = sent[0].split(b"0.000000000000", 1)

    def answer(clock: int) -> None:
        port.sendto(b"%s%.9f%s" % (head, 1.00000001e-9 * clock, tail), exchange._address)
        port.recvfrom(128)

    return answer


def _frames(exchange: Any, row: list[float]) -> Callable[[int], None]:
    """Return what answers a PX4: HIL_SENSOR with other times and checksums."""
    peer, reader, accel, gyro = exchange._peer, ControlsReader(), row[M_ACCEL : M_ACCEL + 3], [0.0] * 3
    rest = (*accel, *gyro, 0.2, 0.0, 0.4, 913.0, 0.0, 0.0, 15.0, 0x1FFF, 0)
    peer.settimeout(None)

    def answer(clock: int) -> None:
        time = (CLOCK_START + clock) // 1000
        peer.sendall(SENSOR.pack(time, *rest))
        while not any(one.time == time for one in reader.feed(peer.recv(4096))):
            pass

    return answer


# -- in the world


class Shares:
    """Time spent in parts of a run [s], by part; a part within another one is not counted twice."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}
        self._open: list[float] = []

    def measure(self, holder: Any, name: str, part: str) -> None:
        """Count the time in the method *name* of *holder* as that of *part*."""
        method = getattr(holder, name)

        def measured(*values: Any, **options: Any) -> Any:
            begun = perf_counter()
            self._open.append(0.0)
            try:
                return method(*values, **options)
            finally:
                whole = perf_counter() - begun
                inner = self._open.pop()
                self.spent[part] = self.spent.get(part, 0.0) + whole - inner
                if self._open:
                    self._open[-1] += whole

        setattr(holder, name, measured)


class Figures(NamedTuple):
    """What one run gave: simulated seconds a second, on the ground and in hover; shares; memory [MB]."""

    ground: float
    hover: float
    shares: dict[str, float]
    memory: list[float]


@contextmanager
def fleet(chosen: list[Program]) -> Iterator[tuple[Any, Any, list[RealFirmware], list[Drone]]]:
    """Yield kernel, world, warmed-up autopilots and the drones among their vehicles."""
    kernel = VirtualKernel()
    world, flights = make_world(kernel.now, [one.spec() for one in chosen], seed=1, frame=FRAME)
    autopilots: list[RealFirmware] = []
    drones: list[Drone] = []
    with TemporaryDirectory() as folder:
        try:
            for number, (program, flight) in enumerate(zip(chosen, flights, strict=True), 1):
                name = f"vehicle_{number}"
                family = RealFirmwareFamily(name=program.project, program=program.path, folder=Path(folder))
                autopilots.append(family.create(kernel, flight, system=number, warm=True, name=name))
                if flight.flying:
                    ours, theirs = in_process_pair(kernel, 2 * MS, name)
                    autopilots[-1].connect(theirs)
                    opened = drivers.load(program.project).on_link
                    assert opened is not None
                    drones.append(Drone(kernel, name, opened(kernel, ours, name, {"system": str(number)})))
            yield kernel, world, autopilots, drones
        finally:
            for drone in drones:
                drone.close()
            for autopilot in autopilots:
                autopilot.close()


def flown(chosen: list[Program], seconds: float, *, measured: bool = False) -> Figures:
    """Stand, take off and hover with these vehicles together."""
    with fleet(chosen) as (kernel, world, autopilots, drones), kernel.adopt(SCRIPT):
        ground = _timed(kernel, seconds)
        for drone in drones:
            drone.wait_ready()
            drone.takeoff(10.0)
        hover = _timed(kernel, seconds)
        shares = Shares()
        if measured:
            shares.measure(world, "_advance", "world")
            for autopilot in autopilots:
                shares.measure(autopilot._exchange, "receive", "firmware")
                shares.measure(autopilot._exchange, "prepare", "exchange")
                shares.measure(autopilot._exchange, "send", "exchange")
                shares.measure(autopilot._ground, "read", "telemetry")
            begun = perf_counter()
            kernel.sleep_until(kernel.now() + int(seconds * S))
            shares.spent["whole"] = perf_counter() - begun
        return Figures(ground, hover, shares.spent, [_memory(one.process.pid) for one in autopilots])


def _timed(kernel: Any, seconds: float) -> float:
    begun = perf_counter()
    kernel.sleep_until(kernel.now() + int(seconds * S))
    return seconds / (perf_counter() - begun)


def _memory(pid: int) -> float:
    pages = int(Path("/proc", str(pid), "statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _shares(spent: dict[str, float]) -> str:
    whole = spent.pop("whole")
    rest = whole - sum(spent.values())
    parts = {**spent, "kernel and components": rest}
    return ", ".join(f"{part} {100.0 * time / whole:.0f} %" for part, time in parts.items())


def main() -> None:
    """Print the tables."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    asked.add_argument("--seconds", type=float, default=20.0, help="simulated time of each measurement")
    asked.add_argument("--repeat", type=int, default=3, help="measurements of each, in turn; the best counts")
    asked.add_argument(
        "--fleet",
        type=lambda text: [int(count) for count in text.split(",")],
        action="append",
        default=[],
        help="numbers of each named program that fly together, such as 4,2,4",
    )
    options = asked.parse_args()
    chosen = programs()
    if not chosen:
        raise SystemExit("name a program: VOLERY_ARDUCOPTER=..., VOLERY_ARDUROVER=... or VOLERY_PX4=...")
    print("simulated seconds a second; ratio to the bare loop; memory of the firmware")
    for program in chosen:
        alone, ours = [], []
        for _ in range(options.repeat):
            alone.append(bare(program, options.seconds))
            ours.append(flown([program], options.seconds))
        best = max(ours, key=lambda one: one.ground)
        print(
            f"{program.words:<12} bare {max(alone):6.1f}   ground {best.ground:6.1f}   "
            f"hover {best.hover:6.1f}   ratio {best.ground / max(alone):.2f}   {best.memory[0]:.0f} MB"
        )
        print(f"{'':<12} {_shares(flown([program], options.seconds, measured=True).shares)}")
    for counts in ([1] * len(chosen), *options.fleet):
        several = [program for program, count in zip(chosen, counts, strict=True) for _ in range(count)]
        if len(several) > 1:
            together = flown(several, options.seconds, measured=True)
            words = " + ".join(f"{count} {one.words}" for one, count in zip(chosen, counts, strict=True))
            print(f"{words}   ground {together.ground:.1f}   hover {together.hover:.1f}")
            print(f"{'':<12} {_shares(together.shares)}")


if __name__ == "__main__":
    main()
