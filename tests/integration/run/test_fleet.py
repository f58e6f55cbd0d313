"""Several vehicles at once in one process: simulated in one world, and out there on sockets."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from volery import (
    AMSL,
    AboveHome,
    Drone,
    Fence,
    Fleet,
    Limits,
    Options,
    Position,
    Rover,
    RunSession,
    connect_fleet,
    simulate,
)
from volery.base.errors import (
    CapabilityError,
    FleetError,
    OutOfBounds,
    Overridden,
    Refused,
    UsageError,
)
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.run.assembly.simulated_fleet import fleet_of
from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.trace.events import Text
from volery.vehicles.address import parse

HOME = Position(46.0825, -103.8995, AMSL(900))
NORTH = Position(46.0828, -103.8995, AboveHome(12.0))
WARM = "start=warm"


@pytest.fixture
def pair() -> Iterator[Fleet]:
    with connect_fleet({"left": f"sim:ardupilot?{WARM}", "right": f"sim:ardupilot?{WARM}"}) as fleet:
        yield fleet


def test_group_operations(pair: Fleet) -> None:
    assert list(pair) == ["left", "right"]
    assert len(pair) == 2
    assert "left" in pair
    pair.wait_ready()
    pair.takeoff(10)
    heights = pair.each(lambda drone: drone.altitude.metres)
    assert list(heights) == ["left", "right"]
    assert all(height == pytest.approx(10.0, abs=0.5) for height in heights.values())
    pair.hold()
    pair.each(lambda drone: drone.goto(NORTH))
    pair.return_home()
    assert not any(drone.armed for drone in pair.values())


def test_they_fly_at_once_not_one_after_the_other(pair: Fleet) -> None:
    pair.takeoff(10)
    kernel = pair["left"].kernel
    start = kernel.now()
    pair["left"].goto(NORTH)
    alone = kernel.now() - start
    start = kernel.now()
    pair.each(lambda drone: drone.goto(Position(NORTH.latitude, -103.8990, AboveHome(12.0))))
    assert kernel.now() - start < 2 * alone


def test_what_some_cannot_do_the_others_do(pair: Fleet) -> None:
    pair["right"].limits = Limits(highest=8.0)
    with pytest.raises(FleetError) as caught:
        pair.takeoff(10)
    assert str(caught.value).startswith("take off to 10 m: 1 failed: right: take off to 10 m: 10 m above")
    assert isinstance(caught.value.failed["right"], OutOfBounds)
    assert pair["left"].altitude.metres == pytest.approx(10.0, abs=0.5)
    with pytest.raises(FleetError) as caught:
        pair.each(lambda vehicle: 1 // 0, "divide")
    assert list(caught.value.failed) == ["left", "right"]
    assert "left: ZeroDivisionError" in str(caught.value)


def test_errors_can_be_picked_by_kind(pair: Fleet) -> None:
    picked: list[str] = []
    try:
        pair.each(lambda drone: drone.goto(NORTH))
    except* Refused as group:
        picked = [str(error) for error in group.exceptions]
    assert len(picked) == 2
    assert "takeoff(height) first" in picked[0]


def test_landing_ends_what_others_have_under_way(pair: Fleet) -> None:
    pair.takeoff(10)
    kernel = pair["left"].kernel
    raised: list[Exception] = []

    def go_far() -> None:
        try:
            pair["left"].goto(Position(46.0900, -103.8995, AboveHome(12.0)), speed=2.0)
        except Overridden as error:
            raised.append(error)

    kernel.spawn(go_far, "far", kernel.current().context)  # type: ignore[union-attr]
    sleep(kernel, 3 * S)
    pair.land()
    assert [type(error) for error in raised] == [Overridden]
    assert not any(drone.armed for drone in pair.values())


def test_drones_and_rovers_in_one_fleet() -> None:
    urls = {"air": f"sim:ardupilot?{WARM}", "ground": f"sim:ardupilot?{WARM}"}
    with connect_fleet(urls, {"ground": Rover}) as fleet:
        fleet.takeoff(8)
        assert isinstance(fleet["air"], Drone)
        assert fleet["air"].flying
        assert isinstance(fleet["ground"], Rover)
        fleet.land()
        assert not fleet["air"].armed


def test_each_has_a_system_id_of_its_own() -> None:
    stated = {"a": "sim:ardupilot", "b": "sim:ardupilot?system=1", "c": "sim:ardupilot"}
    wanted = [parse_simulated(parse(url), name) for name, url in stated.items()]
    fleet = fleet_of(VirtualKernel(), wanted, 1)
    assert [one.vehicle.system for one in fleet.autopilots.values()] == [2, 1, 3]


@pytest.mark.parametrize(
    ("urls", "error", "says"),
    [
        ({}, UsageError, "a fleet needs at least one vehicle"),
        ({"a": "sim:ardupilo"}, UsageError, r"ardupilo.*did you mean 'ardupilot'"),
        (
            {"a": "ardupilot+tcp://127.0.0.1:5760", "b": "sim:ardupilot"},
            CapabilityError,
            "simulated and real vehicles have different clocks",
        ),
        (
            {"a": "ardupilot+udp://:45123", "b": "px4+udp://:45123"},
            UsageError,
            r"a and b share one udp address; .*\?system=1",
        ),
        (
            {"a": "ardupilot+udp://:45123?system=2", "b": "px4+udp://:45123?system=2"},
            UsageError,
            "give each its system id",
        ),
        (
            {"a": "ardupilot+udp://:45123?system=1", "b": "paparazzi+udp://:45123?system=2"},
            UsageError,
            "one link carries one protocol, not MAVLink or pprzlink",
        ),
        (
            {"a": "sim:ardupilot?system=3", "b": "sim:ardupilot?system=3"},
            UsageError,
            "each vehicle needs its own",
        ),
        ({"a": "sim:ardupilot?system=0"}, UsageError, "no system id from 1 to 250"),
    ],
)
def test_fleets_that_make_no_sense(urls: dict[str, str], error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says), connect_fleet(urls):
        pass


def test_a_vehicle_that_is_not_in_it(pair: Fleet) -> None:
    with pytest.raises(UsageError, match=r"no vehicle 'lft' in the fleet .did you mean 'left'"):
        pair["lft"]
    with pytest.raises(UsageError, match="a fleet of no vehicles"):
        Fleet({})


def test_a_fence_for_all_that_excludes_home() -> None:
    fence = Fence(((10.0, 10.0), (10.0, 11.0), (11.0, 11.0)))
    with (
        pytest.raises(UsageError, match="a: the fence excludes home"),
        connect_fleet({"a": "sim:ardupilot"}, fence=fence),
    ):
        pass


# -- on sockets


def free_port(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@contextmanager
def served(*listening: tuple[str, int]) -> Iterator[None]:
    """``volery vehicle serve`` at each address, with each system id, in a process of its own."""
    start = [
        sys.executable,
        "-c",
        "from volery.cli.main import main; main()",
        "vehicle",
        "serve",
        "--speed",
        "4",
    ]
    processes: list[subprocess.Popen[Any]] = []
    try:
        for url, system in listening:
            command = [*start, "--listen", url, "--system", str(system)]
            processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT))
        for one in processes:
            assert one.stdout is not None
            assert b"serving" in one.stdout.readline()
        yield
    finally:
        for one in processes:
            one.terminate()
        for one in processes:
            one.communicate(timeout=300)


@pytest.mark.integration
def test_four_on_sockets_two_of_them_behind_one_port() -> None:
    one, other = free_port(socket.SOCK_STREAM), free_port(socket.SOCK_STREAM)
    port = free_port(socket.SOCK_DGRAM)
    urls = {
        "a": f"ardupilot+tcp://127.0.0.1:{one}",
        "b": f"ardupilot+tcp://127.0.0.1:{other}",
        "c": f"ardupilot+udp://:{port}?system=7",
        "d": f"ardupilot+udp://:{port}?system=8",
    }
    there = f"udp://127.0.0.1:{port}"
    with (
        served((f"tcp://127.0.0.1:{one}", 1), (f"tcp://127.0.0.1:{other}", 1), (there, 7), (there, 8)),
        connect_fleet(urls) as fleet,
    ):
        fleet.wait_ready()
        fleet.takeoff(6)
        assert all(drone.altitude.metres > 5.0 for drone in fleet.values())
        fleet["c"].goto(Position(46.08258, -103.8995, AboveHome(6.0)))
        assert fleet["d"].position.latitude == pytest.approx(46.0825, abs=3e-5)  # it was not meant
        fleet.land()
        assert not any(drone.armed for drone in fleet.values())


# -- a number of vehicles of a model

HOPS = """\
volery: 1
name: hops
components:
  Hop: {language: python, path: hop.py, requires: {drone: Drone}, active: true}
  Watch: {language: python, path: hop.py, requires: {drones: "Drone[]"}, active: true}
application:
  hop: {is: Hop, drone: drone}
  watch: {is: Watch, drones: drone}
platform:
  processors:
    ground: {is: intel-i5-3470, frequency: 3 GHz}
    onboard: {is: rpi4-cortex-a72, frequency: 1500 MHz, carried_by: drone}
allocations: {all: {hop: onboard, watch: ground}}
environment:
  vehicles: {drone: {count: 3, kind: multirotor, autopilot: ardupilot, at: {east: 0, north: 0}}}
requirements: {away: {observe: drone.distance, max: 1 m}}
run: {duration: 6 s}
"""
HOP = """\
import volery
class Hop:
    def __init__(self, drone):
        self.drone = drone
    def run(self):
        self.drone.arm()
class Watch:
    def __init__(self, drones):
        self.drones = drones
    def run(self):
        for drone in self.drones:
            drone.wait_ready()
            volery.note("seen", str(drone.name), "ready")
"""


@pytest.mark.parametrize("count", [1, 3, 5])
def test_a_model_runs_with_any_number_of_vehicles(tmp_path: Any, count: int) -> None:
    (tmp_path / "model.yaml").write_text(HOPS)
    (tmp_path / "hop.py").write_text(HOP)
    changes = (f"environment.vehicles.drone.count={count}",)
    run = simulate(tmp_path, Options(record="summary"), overrides=changes)
    names = [f"drone_{i}" for i in range(1, count + 1)]
    assert run.record.outcome.status == "completed"
    assert list(run.record.requirements) == [f"away_{i}" for i in range(1, count + 1)]
    assert [name for name in run.record.components if name.startswith("hop")] == [
        f"hop_{i}" for i in range(1, count + 1)
    ]
    assert list(run.record.vehicles) == names


SHUTTLE = """\
volery: 1
name: shuttle
components:
  Shuttle: {language: python, path: hop.py, requires: {drone: Drone}, active: true}
application: {shuttle: {is: Shuttle, drone: drone_1}}
platform: {processors: {onboard: {is: rpi4-cortex-a72, frequency: 1500 MHz, carried_by: drone_1}}}
allocations: {all: {shuttle: onboard}}
environment:
  places: {port: {east: 1 m, north: 0, battery_swap: 20 s}, field: {east: 30 m, north: 0}}
  vehicles: {drone_1: {kind: multirotor, autopilot: ardupilot, at: port, battery: 0.5 Ah}}
requirements: {trips: {observe: note.trip.flown, min: 4}, battery: {observe: drone_1.battery_min, min: 0.5}}
run: {duration: 4 min, until: {observe: note.trip.flown, min: 4}}
"""
SHUTTLE_CODE = """\
import time
import volery
class Shuttle:
    def __init__(self, drone):
        self.drone = drone
    def run(self):
        self.drone.wait_ready()
        for trip in range(4):
            self.drone.takeoff(4)
            self.drone.land()
            volery.note("trip", str(trip), "flown")
            time.sleep(22)
"""


def _shuttle(folder: Any, *changes: str) -> tuple[Any, list[str]]:
    (folder / "model.yaml").write_text(SHUTTLE)
    (folder / "hop.py").write_text(SHUTTLE_CODE)
    session = RunSession(folder, Options(record="summary"), overrides=changes)
    told: list[str] = []
    session.tap(lambda event: told.append(event.text), Text)
    return session.run(), [one for one in told if "swapped" in one]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_battery_is_swapped_where_a_vehicle_stands(tmp_path: Any, autopilot: str) -> None:
    run, told = _shuttle(tmp_path, f"environment.vehicles.drone_1.autopilot={autopilot}")
    assert run.record.requirements["trips"].met
    assert run.record.requirements["battery"].met
    assert len(told) == 3
    assert all(one.startswith("battery swapped at port: ") for one in told)


def test_without_a_swap_the_battery_does_not_last(tmp_path: Any) -> None:
    run, told = _shuttle(tmp_path, "environment.places.port.battery_swap=", "run.duration=100 s")
    assert not run.record.requirements["battery"].met
    assert told == []
