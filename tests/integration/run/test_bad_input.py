"""Bad input as a user meets it: the exit status, a message that names the offender, and no traceback."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from volery.base.errors import UsageError
from volery.cli.main import application
from volery.run.fly import fly

pytestmark = pytest.mark.integration

BAD, FAILED = 2, 1
LAND = "        self._drone.land()\n"
ZONE = (
    "  places:\n",
    "  no_fly_zones:\n    school: {centre: {east: 60 m, north: 0 m}, radius: 15 m}\n  places:\n",
)
CYCLE = (
    ("components:\n", "interfaces:\n  Talk: {say: {}}\ncomponents:\n"),
    (
        "application:\n",
        """  Parrot:
    language: python
    provides: {talk: Talk}
    requires: {other: Talk}
application:
  one: {is: Parrot, other: two.talk}
  two: {is: Parrot, other: one.talk}
""",
    ),
    ("only: {pilot", "only: {one: onboard, two: onboard, pilot"),
)
BEFORE_THE_START = {
    "a typo in a key": ([("requires: {drone", "requirs: {drone")], ("model.yaml:8", "requirs", "requires")),
    "a missing file": ([("pilot.py", "pilto.py")], ("model.yaml:7", "pilto.py")),
    "a cycle of required ports": (CYCLE, ("one", "two", "cycle")),
    "an unknown processor": (
        [("onboard: {is: rpi4-cortex-a72", "onboard: {is: rpi4-cortex-a27")],
        ("rpi4-cortex-a27", "did you mean 'rpi4-cortex-a72'", "intel-i5-3470"),
    ),
    "a frequency outside the range": (
        [("frequency: 1500 MHz, carried", "frequency: 9 GHz, carried")],
        ("9000", "1500", "onboard"),
    ),
    "an allocation to nowhere": ([("{pilot: onboard}", "{pilot: offboard}")], ("offboard", "onboard")),
    "an unknown observable": (
        [("run:\n", "requirements:\n  near: {observe: drone_1.landing_ofset, max: 1 m}\nrun:\n")],
        ("landing_ofset", "landing_offset"),
    ),
    "a place off the globe": ([("latitude: 43.4717", "latitude: 93.4717")], ("93.4717", "latitude")),
    "a time for another processor": (
        [
            (
                "at: {processor: rpi4-cortex-a72, frequency: 1500",
                "at: {processor: intel-i5-3470, frequency: 3000",
            )
        ],
        ("pilot", "intel-i5-3470", "rpi4-cortex-a72"),
    ),
    "a fault in the Python of a component": ([("pilot.py", "broken.py")], ("broken.py:1", "not Python")),
    "a class that is not there": ([("path: pilot.py", "path: empty.py")], ("empty.py", "Pilot")),
}


def go(lat, lon, altitude):
    return f"        self._drone.goto(volery.Position({lat}, {lon}, volery.{altitude}))\n"


ON_THE_WAY = {
    "underground": (
        go(43.4718, -3.7997, "AMSL(5)"),
        ("underground", "did you mean AboveHome(5)", "Home is 12."),
    ),
    "too far": (go(43.7, -3.7997, "AMSL(30)"), ("25.4 km", "10 km", "Limits.farthest")),
    "too high": (
        go(43.4718, -3.7997, "AMSL(500)"),
        ("m above home, but the limit is 120 m", "120 m", "Limits.highest"),
    ),
    "off the globe": (go(43.4718, -183.7997, "AMSL(20)"), ("longitude -183.7997", "off the globe")),
    "in a no-fly zone": (go(43.4717, -3.79896, "AMSL(20)"), ("no-fly zone 'school'",)),
    "through a no-fly zone": (go(43.4717, -3.79822, "AMSL(20)"), ("no-fly zone 'school'",)),
    "not above the ground": ("        self._drone.takeoff(-3)\n", ("-3",)),
}


def volery(*arguments):
    done = CliRunner().invoke(application(), [str(one) for one in arguments])
    said = " ".join(done.output.split())
    assert "Traceback" not in said
    assert done.exception is None or isinstance(done.exception, SystemExit)
    return done.exit_code, said


@pytest.mark.parametrize("case", BEFORE_THE_START)
def test_what_is_wrong_with_a_model_is_said_before_it_runs(case, one_drone, tmp_path):
    changes, names = BEFORE_THE_START[case]
    folder = one_drone(tmp_path, LAND, *changes)
    (folder / "broken.py").write_text("def :\n")
    (folder / "empty.py").write_text("")
    status, said = volery("simulate", folder, "--fidelity", "times", "--out", tmp_path / "out")
    assert status == BAD, said
    for name in names:
        assert name in said
    assert not (tmp_path / "out" / "trace.mcap").exists()


@pytest.mark.parametrize("case", ON_THE_WAY)
def test_a_goal_that_is_out_of_bounds_ends_the_run_and_the_drone_comes_down(case, one_drone, tmp_path):
    code, names = ON_THE_WAY[case]
    status, said = volery("simulate", one_drone(tmp_path, code, ZONE), "--out", tmp_path / "out")
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert status in {BAD, FAILED}
    assert record["outcome"]["status"] == "failed"
    assert "pilot" in record["outcome"]["reason"]
    assert record["vehicles"]["drone_1"]["landed"]
    for name in names:
        assert name in said


@pytest.mark.parametrize(
    ("parameters", "names"),
    [
        ("{BATT_ARM_VOLT: 99}", ("drone_1", "Battery 1 below minimum arming voltage")),
        ("{BATT_ARM_MAH: 90000}", ("drone_1", "Battery 1 below minimum arming capacity")),
    ],
)
def test_an_autopilot_that_never_becomes_ready_is_quoted(parameters, names, one_drone, tmp_path):
    start = ("at: pad, battery: 5 Ah", f"at: pad, battery: 5 Ah, parameters: {parameters}")
    status, said = volery("simulate", one_drone(tmp_path, LAND, start), "--out", tmp_path / "out")
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert status == FAILED
    for name in names:
        assert name in said
    assert record["outcome"]["status"] == "failed"
    assert record["vehicles"]["drone_1"]["airborne_s"] == 0.0


ARM_AT_ONCE = "def mission(drone):\n    drone.arm()\n"


def test_an_autopilot_that_refuses_to_arm_is_quoted(tmp_path):
    (tmp_path / "mission.py").write_text(ARM_AT_ONCE)
    status, said = volery("fly", tmp_path / "mission.py", "--on", "sim:ardupilot", "--out", tmp_path / "out")
    assert status == FAILED
    assert "ardupilot: arm:" in said
    assert "Arm: " in said or "PreArm: " in said


@pytest.mark.parametrize(
    ("call", "hint"),
    [
        ("drone.wait_ready(); drone.takeoff(940)", "did you mean AMSL(940)? Home is 900"),
        ("drone.goto(Position(46.0828, -103.8990, AMSL(40)))", "did you mean AboveHome(40)? Home is 900"),
    ],
)
def test_who_mixes_up_heights_gets_a_hint(call, hint, tmp_path):
    before = "" if "takeoff" in call else "    drone.takeoff(10)\n"
    mission = f"from volery import AMSL, Position\n\ndef mission(drone):\n{before}    {call}\n"
    (tmp_path / "mission.py").write_text(mission)
    url = "sim:ardupilot?sensors=rtk"
    status, said = volery("fly", tmp_path / "mission.py", "--on", url, "--out", tmp_path / "out")
    assert status == FAILED
    assert hint in said
    (drone,) = json.loads((tmp_path / "out" / "run.json").read_text())["vehicles"].values()
    assert drone["landed"]


@pytest.mark.parametrize(
    ("mission", "says"),
    [
        ("def misson(drone):\n    pass\n", "misson"),
        ("def mission(drone, rover):\n    pass\n", "takes one vehicle"),
        ("HOME = (1, 2)\n\ndef mission(drone):\n    pass\n", "HOME"),
        ("def mission(drone)\n    pass\n", "mission.py:1: not Python"),
    ],
)
def test_a_file_that_is_no_mission(mission, says, tmp_path):
    (tmp_path / "mission.py").write_text(mission)
    status, said = volery("fly", tmp_path / "mission.py", "--on", "sim:ardupilot", "--out", tmp_path / "out")
    assert status == BAD, said
    assert says in said


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("sim:ardupilot?colour=red", "colour"),
        ("sim:ardupilot?home=91,0,0", "latitude 91.0 is off the globe"),
        ("sim:ardupilot?drop=0.1", "wire=bytes"),
        ("sim:ardupilot?wire=bytes&drop=2", "drop=2.0"),
        ("sim:ardupilot?sensors=laser", "consumer, rtk or sih"),
        ("mavros+graph:///drone_1", "components of a model"),
    ],
)
def test_an_address_that_makes_no_sense(url, says, mission_file, tmp_path):
    status, said = volery("fly", mission_file, "--on", url, "--out", tmp_path / "out")
    assert status == BAD, said
    assert says in said


def test_no_address_at_all():
    with pytest.raises(UsageError, match="sim:ardupilot"):
        fly(lambda drone: None, [])
