"""The five-line mission and its like, on simulated vehicles: with a file, a function, a script, a REPL."""

from __future__ import annotations

import code
import json
import subprocess
import sys

import pytest

from volery import AMSL, Drone, Options, Position, Rover, connect, fly
from volery.base.errors import LinkLost
from volery.simulation.world.sensors import declared_sigma

pytestmark = pytest.mark.integration

HORIZONTAL, VERTICAL = 1.0, 0.5
"""How near a point must be, in metres."""


def legs(vehicle, operation):
    return [one for one in vehicle.operations if one.operation == operation]


def flown(mission, url, seed=7, **options):
    run = fly(mission, url, Options("hardware", seed, **options))
    assert run.completed, run.record.outcome
    return run


def assert_down(vehicle):
    assert vehicle.landed
    assert vehicle.airborne_s > 0.0


@pytest.mark.parametrize(
    ("autopilot", "seed"),
    [*(("ardupilot", seed) for seed in range(1, 9)), ("px4", 1), ("paparazzi", 1), ("dji", 1)],
)
def test_each_point_is_reached_by_the_autopilots_own_estimate(mission_file, autopilot, seed):
    (drone,) = flown(mission_file, f"sim:{autopilot}", seed).record.vehicles.values()
    sigma = declared_sigma("consumer")
    assert len(legs(drone, "goto")) == 3
    for leg in legs(drone, "goto"):
        assert leg.error_by_estimate_m.horizontal < HORIZONTAL
        assert leg.error_by_estimate_m.vertical < VERTICAL
        assert leg.error_by_truth_m.horizontal < 3.0 * sigma.horizontal
        assert leg.error_by_truth_m.vertical < 3.0 * sigma.vertical
    assert max(leg.error_by_truth_m.horizontal for leg in legs(drone, "goto")) > 0.0
    assert_down(drone)
    assert [one.outcome for one in drone.operations] == ["ok"] * len(drone.operations)


@pytest.mark.parametrize("seed", range(1, 9))
def test_with_the_better_receiver_each_point_is_reached_by_truth(mission_file, seed):
    (drone,) = flown(mission_file, "sim:ardupilot?sensors=rtk", seed).record.vehicles.values()
    sigma = declared_sigma("rtk")
    for leg in legs(drone, "goto"):
        assert leg.error_by_truth_m.horizontal < HORIZONTAL
        assert leg.error_by_truth_m.vertical < VERTICAL
    assert len(legs(drone, "goto")) == 3
    assert 3.0 * sigma.horizontal < HORIZONTAL
    assert 3.0 * sigma.vertical < VERTICAL
    assert_down(drone)


def test_several_at_once_fly_each_their_own_way(mission_file):
    run = flown(mission_file, ["sim:ardupilot", "sim:ardupilot", "sim:ardupilot?heading=90"])
    assert list(run.record.vehicles) == ["ardupilot_1", "ardupilot_2", "ardupilot_3"]
    errors = set()
    for drone in run.record.vehicles.values():
        assert_down(drone)
        errors.add(legs(drone, "goto")[1].error_by_truth_m.horizontal)
    assert len(errors) == 3  # sensors and wind are each one's own


@pytest.mark.parametrize("wire", ["bytes", "bytes&drop=0.03&flip=1e-5&burst=0.003&jitter=0.02"])
def test_over_real_bytes_that_suffer(mission_file, wire):
    (drone,) = flown(mission_file, f"sim:ardupilot?wire={wire}").record.vehicles.values()
    assert_down(drone)
    for leg in legs(drone, "goto"):
        assert leg.error_by_estimate_m.horizontal < HORIZONTAL
        assert leg.error_by_estimate_m.vertical < VERTICAL


def test_a_link_that_drops_in_flight_and_returns(mission_file):
    (drone,) = flown(mission_file, "sim:ardupilot?wire=bytes&cut=70-73").record.vehicles.values()
    (under_way,) = [leg for leg in legs(drone, "goto") if leg.start_s < 70.0 and leg.end_s > 73.0]
    assert under_way.outcome == "ok"
    assert_down(drone)


def test_a_link_that_drops_for_good_is_the_end_of_a_mission_and_names_the_drone(mission_file):
    run = fly(mission_file, "sim:ardupilot?wire=bytes&cut=70-100000")
    assert run.record.outcome.status == "failed"
    assert "ardupilot" in run.record.outcome.reason
    assert isinstance(run.error, LinkLost)
    assert any("it is unknown whether" in failure.what for failure in run.record.failures)


def round_the_yard(rover: Rover) -> None:
    rover.wait_ready()
    home = rover.position
    rover.drive((home.latitude + 2e-4, home.longitude), speed=2.0)
    rover.return_home()


def test_a_rover_drives_there_and_back(tmp_path):
    run = flown(round_the_yard, "sim:ardupilot", out=tmp_path)
    (rover,) = run.record.vehicles.values()
    assert rover.kind == "rover"
    assert rover.distance_m > 40.0
    assert rover.landed  # it stands, disarmed
    assert legs(rover, "drive")[0].error_by_estimate_m.horizontal < 2.0
    assert {"run.json", "trace.mcap", "timeline.json", "report.html"} <= {
        path.name for path in tmp_path.iterdir()
    }


SCRIPT = """
import volery

with volery.connect("sim:ardupilot") as drone:
    drone.takeoff(10)
    print(f"{drone.altitude.metres:.0f} {drone.mode}")
print(drone.armed)
"""


def test_connect_in_a_plain_script():
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["10", "GUIDED", "False"]  # whoever leaves it in the air has it landed


def test_connect_line_by_line_as_in_a_repl(capsys):
    console = code.InteractiveConsole()
    for line in (
        "import volery",
        "context = volery.connect('sim:ardupilot?sensors=rtk')",
        "drone = context.__enter__()",
        "drone.takeoff(5)",
        "drone.goto(volery.Position(143.0, 0.0, volery.AMSL(9)))",  # a mistake ends nothing
        "height = drone.altitude.metres",
        "drone.land()",
        "armed = drone.armed",
        "context.__exit__(None, None, None)",
    ):
        assert not console.push(line)
    assert console.locals["height"] == pytest.approx(5.0, abs=0.5)
    assert not console.locals["armed"]
    assert "latitude 143.0 is off the globe" in capsys.readouterr().err


def test_an_error_in_the_script_brings_the_drone_down_and_is_the_scripts():
    def script():
        with connect("sim:ardupilot") as drone:
            drones.append(drone)
            drone.takeoff(5)
            raise ZeroDivisionError

    drones = []
    with pytest.raises(ZeroDivisionError):
        script()
    assert not drones[0].armed


def too_far(drone: Drone) -> None:
    drone.takeoff(10)
    drone.goto(Position(46.0825, -103.7, AMSL(920)))


def test_a_mission_that_asks_too_much_ends_on_the_ground():
    run = fly(too_far, "sim:ardupilot")
    assert run.record.outcome.status == "failed"
    assert "Limits.farthest" in run.record.outcome.reason
    (drone,) = run.record.vehicles.values()
    assert_down(drone)
    assert json.loads(run.record.model_dump_json())["failures"]
