"""``volery fly`` with a fence, a ceiling and a reserve; and what it says to what makes no sense."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from volery.base.position import AboveHome
from volery.cli.main import application
from volery.run.assembly.fences import read_fence

FAILED, BAD = 1, 2
HOME = (46.0825, -103.8995)

UP_AND_NORTH = """
import volery
from volery import AMSL, AboveHome, Drone, Fence, Limits, Position

HOME = Position(46.0825, -103.8995, AMSL(900))

def mission(drone: Drone) -> None:
    drone.takeoff(10)
    drone.goto(Position(46.0834, -103.8995, AboveHome(15)))
    drone.land()
"""


def ring(half: float, north: float = 0.0, east: float = 0.0) -> list[list[float]]:
    """A closed square about home, in degrees, longitude first."""
    latitude, longitude = HOME[0] + north, HOME[1] + east
    corners = ((-half, -half), (half, -half), (half, half), (-half, half), (-half, -half))
    return [[longitude + x, latitude + y] for x, y in corners]


def polygon(*rings: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": "Polygon", "coordinates": list(rings)}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def collection(*features: dict[str, Any]) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features)}


@pytest.fixture
def fly(tmp_path: Path) -> Any:
    def run(
        *options: str, fence: Any = None, mission: str = UP_AND_NORTH, url: str = "sim:ardupilot?start=warm"
    ) -> Any:
        file = tmp_path / "up.py"
        file.write_text(mission)
        given = list(options)
        if fence is not None:
            path = tmp_path / "fence.geojson"
            path.write_text(fence if isinstance(fence, str) else json.dumps(fence))
            given += ["--fence", str(path)]
        arguments = ["fly", str(file), "--on", url, "--out", str(tmp_path / "run"), *given]
        result = CliRunner().invoke(application(), arguments)
        assert "Traceback" not in result.output + result.stderr
        said = " ".join((result.output + result.stderr).split())
        return result.exit_code, said

    return run


# -- what holds


def test_inside_everything_it_flies_and_says_what_it_does_if_left_alone(fly: Any) -> None:
    status, said = fly("--ceiling", "40", "--reserve", "20%", fence=polygon(ring(0.002)))
    assert status == 0
    assert "ardupilot: if this program stops sending: it " in said


@pytest.mark.parametrize(
    ("options", "fence", "says"),
    [
        ((), polygon(ring(0.0005)), "the goal is outside the fence"),
        ((), polygon(ring(0.002), ceiling=12), "above the fence's ceiling of 12 m above home"),
        (
            (),
            collection(polygon(ring(0.002)), polygon(ring(0.0002, north=0.0005), no_fly=True, name="school")),
            "leads through the no-fly zone 'school'",
        ),
        ((), polygon(ring(0.002), ring(0.0002, north=0.0005)), "no-fly zone 'hole 1 of polygon 1'"),
        (("--ceiling", "12"), None, "15 m above home asked, but the limit is 12 m (Limits.highest)"),
        (("--reserve", "0.999"), None, "below the reserve of 100% (Limits.battery_reserve)"),
    ],
)
def test_what_is_out_of_bounds_ends_the_flight_on_the_ground(
    fly: Any, options: tuple[str, ...], fence: Any, says: str
) -> None:
    status, said = fly(*options, fence=fence)
    assert status == FAILED
    assert says in said
    assert "at rest" in said


def test_a_mission_may_state_its_own(fly: Any) -> None:
    stated = UP_AND_NORTH + "\nLIMITS = Limits(highest=12)\n"
    status, said = fly(mission=stated)
    assert status == FAILED
    assert "the limit is 12 m" in said
    assert fly("--ceiling", "20", mission=stated)[0] == 0  # an option holds instead of it
    corner = "(46.0827, -103.8990), (46.0827, -103.9), (46.0820, -103.9), (46.0820, -103.8990)"
    status, said = fly(mission=UP_AND_NORTH + f"\nFENCE = Fence(({corner}))\n")
    assert "the goal is outside the fence" in said


# -- bad input


@pytest.mark.parametrize(
    ("fence", "says"),
    [
        ("{", "no JSON"),
        ("[]", "a GeoJSON object is expected"),
        ('{"type": "Point"}', "type 'Point'; there is Feature, FeatureCollection"),
        (
            '{"type": "FeatureCollection", "features": []}',
            "features: a list with at least one entry is expected",
        ),
        ({"type": "Polygon", "coordinates": [[]]}, "a list with at least one entry is expected"),
        ({"type": "Polygon", "coordinates": [[[1, 2], [3, 4]]]}, "has 2 corners; it takes at least 3"),
        ({"type": "Polygon", "coordinates": [[[1, "x"], [3, 4], [5, 6]]]}, "no [longitude, latitude]"),
        (
            {"type": "Polygon", "coordinates": [[[46, -103.9], [46, -103.8], [47, -103.8]]]},
            "are they swapped?",
        ),
        (polygon(ring(0.002), ceiling="high"), "ceiling: 'high' is no number of metres above home"),
        (polygon(ring(0.002), ceiling=5, floor=9), "its floor of 9 m above home is not below its ceiling"),
        (collection(polygon(ring(0.002)), polygon(ring(0.001))), "a second inclusion polygon"),
        (polygon(ring(0.002, east=0.1)), "the fence excludes home"),
        (polygon(ring(0.0004), no_fly=True, name="park"), "excludes home: home"),
    ],
)
def test_fences_that_make_no_sense(fly: Any, fence: Any, says: str) -> None:
    status, said = fly(fence=fence)
    assert status == BAD
    assert says in said


def test_a_fence_that_is_not_there(fly: Any, tmp_path: Path) -> None:
    status, said = fly("--fence", str(tmp_path / "nowhere.geojson"))
    assert status == BAD
    assert "cannot read the fence" in said
    assert "No such file" in said


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--reserve", "lots"), "--reserve lots: give a share of the battery, such as 20% or 0.2"),
        (("--reserve", "120%"), "a share of the battery"),
        (("--reserve", "nan"), "a share of the battery"),
        (("--ceiling", "nan"), "leaves no room to fly"),
        (("--ceiling", "-5"), "leaves no room to fly"),
    ],
)
def test_options_that_make_no_sense(fly: Any, options: tuple[str, ...], says: str) -> None:
    status, said = fly(*options)
    assert status == BAD
    assert says in said


@pytest.mark.parametrize(
    ("line", "status", "says"),
    [
        ("FENCE = 5", BAD, "FENCE is 5; state it as volery.Fence(...)"),
        ("LIMITS = 120", BAD, "LIMITS is 120; state it as volery.Limits(...)"),
        ("LIMITS = Limits(battery_reserve=20)", FAILED, "give a share from 0 to below 1, as 0.2"),
    ],
)
def test_missions_that_state_nonsense(fly: Any, line: str, status: int, says: str) -> None:
    found, said = fly(mission=f"{UP_AND_NORTH}\n{line}\n")
    assert found == status
    assert says in said


@pytest.mark.parametrize(
    ("call", "says"),
    [
        ("drone.goto(HOME)", "it is on the ground; takeoff(height) first"),
        ("drone.takeoff(float('nan'))", "nan is not a finite number; write it as in takeoff(10)"),
        ("drone.manual_control(0, 0, 2, 0)", "throttle=2; it goes from 0 to 1"),
        ("drone.manual_control(0, 0, 0.5, float('nan'))", "nan is not a finite number; write it as"),
        ("drone.stabilize()", "no manual control is newer than 1 s"),
        ("drone.kill(sure=False)", "if that is meant: sure=True"),
    ],
)
def test_calls_that_make_no_sense(fly: Any, call: str, says: str) -> None:
    mission = UP_AND_NORTH.replace("drone.takeoff(10)", f"drone.wait_ready()\n    {call}")
    status, said = fly(mission=mission)
    assert status in {FAILED, BAD}
    assert says in said


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("sim:ardupilo", "no driver named 'ardupilo' (did you mean 'ardupilot'?); there is ardupilot, "),
        ("px5+udp://:14540", "no driver named 'px5'"),
        ("px4+upd://:14540", "no transport 'upd' (did you mean 'udp'?)"),
        ("dji+tcp://127.0.0.1:5000", "dji is reached over a ROS graph"),
        ("px4+udp://", "lacks the port"),
        ("ardupilot+serial:///dev/ttyUSB0?baud=fast", "baud='fast' is not a number"),
        ("14540", "is not an address"),
    ],
)
def test_addresses_that_make_no_sense(fly: Any, url: str, says: str) -> None:
    status, said = fly(url=url)
    assert status == BAD
    assert says in said


# -- files as they are


def test_a_fence_as_a_map_editor_writes_it(tmp_path: Path) -> None:
    file = tmp_path / "area.geojson"
    area = polygon(ring(0.002), ring(0.0001, north=0.001), name="site", floor=2, ceiling=50)
    file.write_text(json.dumps(collection(area, polygon(ring(0.0002, east=0.001), no_fly=True, ceiling=20))))
    fence = read_fence(file)
    assert len(fence.polygon) == 4
    assert fence.polygon[0] == (46.0805, -103.9015)
    assert (fence.floor, fence.ceiling) == (AboveHome(2.0), AboveHome(50.0))
    assert [(zone.name, zone.ceiling) for zone in fence.no_fly] == [
        ("hole 1 of site", None),
        ("polygon 2", AboveHome(20.0)),
    ]


# -- what answers is not what was expected


@pytest.mark.integration
def test_an_autopilot_of_another_make_answers(fly: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    command = [
        sys.executable,
        "-c",
        "from volery.cli.main import main; main()",
        "vehicle",
        "serve",
        "ardupilot",
    ]
    listen = ["--listen", f"tcp://127.0.0.1:{port}"]
    with subprocess.Popen([*command, *listen], stdout=subprocess.PIPE) as served:
        try:
            assert served.stdout is not None
            assert b"serving" in served.stdout.readline()
            status, said = fly(url=f"px4+tcp://127.0.0.1:{port}")
            assert status == FAILED
            assert "px4: an ArduPilot answers here, not a PX4" in said
            status, said = fly(url=f"paparazzi+tcp://127.0.0.1:{port}")
            assert status == FAILED
            assert "MAVLink arrives, not pprzlink" in said
        finally:
            served.terminate()
