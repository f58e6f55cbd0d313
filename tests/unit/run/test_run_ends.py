"""What a run itself does at its start and end is reported, and is not taken for the service's."""

import shutil

import pytest

from volery import AMSL, Drone, Position
from volery.cli.commands.first_steps import example
from volery.run.fly import fly
from volery.run.result import Options
from volery.run.simulate import simulate
from volery.trace.events import Operation
from volery.trace.reader import OpenTrace


@pytest.fixture(scope="module")
def failed(tmp_path_factory):
    """Run the starter with a component that fails in the air, moving."""
    folder = tmp_path_factory.mktemp("failed")
    shutil.copytree(example("starter"), folder / "model")
    file = folder / "model" / "components" / "patrol.py"
    text = file.read_text()
    assert text.count("        for post in posts:\n") == 1
    moving = (
        "self._drone.set_velocity(east=5)",
        "volery.sleep(2)",
        "raise ValueError('lost')",
        "for post in posts:",
    )
    file.write_text(
        text.replace("        for post in posts:\n", "".join(f"        {one}\n" for one in moving))
    )
    return simulate(folder / "model", Options(fidelity="code", out=folder / "run"))


def test_the_landing_at_the_end_of_a_failed_run_is_not_judged(failed):
    assert not failed.completed
    found = failed.record.requirements["landing"]
    assert found.observed is None
    assert found.met is False


def test_it_is_recorded_as_what_it_is(failed):
    with OpenTrace(failed.folder / "trace.mcap") as reading:
        done = [event for event in reading.events() if isinstance(event, Operation)]
    assert done[-1].operation == "come_to_rest"
    assert (done[-1].asked, done[-1].outcome) == ("land", "ok")
    assert "land" not in {event.operation for event in done}


HOME = Position(43.47, -3.79, AMSL(12))


def hop(drone: Drone) -> None:
    drone.takeoff(3)
    drone.land()


def test_a_mission_without_home_reports_where_it_flies():
    told = []
    without = type(hop)(hop.__code__, {"Drone": Drone})
    assert fly(without, "sim:ardupilot", Options(tell=told.append)).completed
    assert told[0].startswith("no HOME is stated: it flies at 46.0825000, -103.8995000, 900 m AMSL")
    assert told[0].endswith("home=LATITUDE,LONGITUDE,ALTITUDE in the address moves it")  # there is no file


@pytest.mark.parametrize(
    ("mission", "url"),
    [(hop, "sim:ardupilot"), (type(hop)(hop.__code__, {}), "sim:ardupilot?home=43.47,-3.79,12")],
)
def test_a_stated_home_is_not_repeated(mission, url):
    told = []
    assert fly(mission, url, Options(tell=told.append)).completed
    assert not [line for line in told if "HOME" in line]
