"""Observables of other packages: found by entry point, judged, in run.json, with a table in the report."""

import json
import sys
import tomllib
from math import nan
from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.base.time import S
from volery.report.html_report import recover
from volery.requirements.accounts import Accounts
from volery.requirements.added_observables import AddedObservables, ObservedQuantity, added_observables
from volery.requirements.observables import all_observables, make_observer
from volery.requirements.record import TableRecord
from volery.run.result import Options
from volery.run.simulate import simulate
from volery.trace.attachments import RunSetup, VehicleSetup
from volery.trace.events import Failure, VehicleState

EXAMPLE = Path(__file__).parents[3] / "examples" / "separation"
SETUP = RunSetup(vehicles=(VehicleSetup("drone_1"), VehicleSetup("drone_2"), VehicleSetup("drone_3")))


@pytest.fixture
def separation_package(tmp_path, monkeypatch):
    """The example package as an installer leaves it: its module and its metadata on the path."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    site = tmp_path / "site"
    info = site / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    groups = [
        f"[{group}]\n" + "".join(f"{name} = {target}\n" for name, target in entries.items())
        for group, entries in project["entry-points"].items()
    ]
    (info / "entry_points.txt").write_text("\n".join(groups))
    (site / "separation.py").write_text((EXAMPLE / "separation.py").read_text())
    monkeypatch.syspath_prepend(str(site))
    registry = vars(added_observables)
    registry.pop("_installed", None)  # another test may have read what is installed
    yield
    registry.pop("_installed", None)
    sys.modules.pop("separation", None)


@pytest.fixture
def added(monkeypatch):
    """Registers a class for one test."""
    monkeypatch.setitem(vars(added_observables), "_installed", {})
    known = {}
    monkeypatch.setitem(vars(added_observables), "_added", known)
    return lambda name, made: known.update({name: made})


MODEL = """\
volery: 1
name: two drones
components:
  Hop:
    language: python
    path: hop.py
    requires: {drone: Drone}
    parameters: {height: 2 m}
    active: {}
application:
  low: {is: Hop, drone: drone_1}
  high: {is: Hop, drone: drone_2, parameters: {height: 3 m}}
platform: {processors: {ground: {is: rpi4-cortex-a72, frequency: 1500 MHz}}}
allocations: {all: {low: ground, high: ground}}
environment:
  origin: {latitude: 43.47, longitude: -3.8}
  places: {west: {east: 0 m, north: 0 m}, east: {east: 20 m, north: 0 m}}
  vehicles:
    drone_1: {kind: multirotor, autopilot: ardupilot, at: west}
    drone_2: {kind: multirotor, autopilot: ardupilot, at: east}
requirements:
  apart: {observe: drone_1.separation_min, min: 5 m}
  far_apart: {observe: drone_2.separation_min, min: 0.1 km}
  flown: {observe: note.flight.landed, min: 2}
  soon: {observe: note.flight.landed.time_max, max: 1 s}
run: {duration: 2 min}
"""
HOP = """\
import volery


class Hop:
    def __init__(self, drone, height):
        self.drone, self.height = drone, height

    def run(self):
        volery.note("flight", self.drone.name, "prepared")
        self.drone.takeoff(self.height)
        self.drone.land()
        volery.note("flight", self.drone.name, "landed")
"""


def test_an_installed_package_adds_a_quantity_and_a_table(separation_package, tmp_path):
    (tmp_path / "model.yaml").write_text(MODEL)
    (tmp_path / "hop.py").write_text(HOP)
    out = tmp_path / "out"
    run = simulate(tmp_path / "model.yaml", Options(out=out, seed=3))
    assert run.completed, run.record
    found = json.loads((out / "run.json").read_text())
    least = found["added"]["separation"]["values"]["drone_1.separation_min"]
    assert 19.0 < least < 21.0
    apart, far_apart = found["requirements"]["apart"], found["requirements"]["far_apart"]
    assert (apart["observed"], apart["unit"], apart["met"]) == (least, "m", True)
    assert (far_apart["bound"], far_apart["met"]) == (100.0, False)
    assert found["requirements"]["flown"]["observed"] == 2
    assert not found["requirements"]["soon"]["met"]
    assert found["requirements"]["soon"]["observed"] > 1.0
    assert list(found["notes"]["flight"]) == ["drone_1", "drone_2"]
    html = (out / "report.html").read_text()
    for words in ("Separation in the air", "least distance m", "<h2>Flights", "flights landed"):
        assert words in html
    written = (out / "run.json").read_bytes(), (out / "report.html").read_bytes()
    (out / "run.json").unlink()
    again = recover(out)
    assert again.record.added == run.record.added
    assert (again.record.notes, again.record.requirements) == (run.record.notes, run.record.requirements)
    (out / "run.json").write_bytes(written[0])
    assert recover(out).report.read_bytes() == written[1]


def state(at, vehicle, x, z, armed=True):
    rest = [1.0, *[0.0] * 6, *[nan] * 3, 1.0, 12.0, 1.0]
    return VehicleState(at * S, vehicle, x, 0.0, z, *rest, armed, "")


def test_vehicles_are_apart_while_both_are_in_the_air(separation_package):
    near, alone = (make_observer(f"{name}.separation_min", SETUP) for name in ("drone_1", "drone_3"))
    for event in (
        state(0, "drone_1", 0.0, 2.0, armed=False),
        state(0, "drone_2", 1.0, 2.0, armed=False),
        state(1, "drone_1", 0.0, 5.0),
        state(1, "drone_2", 1.0, 2.1),
        state(2, "drone_2", 3.0, 9.0),
        state(3, "drone_2", 6.0, 13.0),
        state(4, "drone_3", nan, nan),
    ):
        near(event)
        alone(event)
    assert near.value(4 * S) == 5.0
    assert alone.value(4 * S) != alone.value(4 * S)


class Counting(AddedObservables):
    quantities = (ObservedQuantity("troubles", "", "failures, counted"),)
    listens = (Failure,)

    def __init__(self, setup):
        super().__init__(setup)
        self.seen = 0

    def take(self, event):
        self.seen += 1
        if event.what == "fatal":
            raise ZeroDivisionError("of mine")

    def value(self, subject, quantity, at):
        return self.seen


def test_what_a_package_raises_ends_it_and_not_the_run(added):
    added("counting", Counting)
    for what, value, warnings in (
        ("small", 2.0, []),
        ("fatal", None, ["the observables 'counting' ended: ZeroDivisionError: of mine"]),
    ):
        accounts = Accounts(RunSetup())
        watching = make_observer("application.troubles")
        for event in (Failure(0, "a", "small"), Failure(S, "a", what)):
            watching(event)
            accounts(event)
        record = accounts.record("completed")
        assert record.added["counting"].values == {"application.troubles": value}
        assert record.warnings == warnings
        assert len(record.failures) == 2
        assert watching.value(S) == value or value is None


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"subject": "planet"}, "its subject is 'planet'; there is application"),
        (
            {"quantities": (ObservedQuantity("a", "furlong", ""),)},
            "the unit of a: there is no unit 'furlong'",
        ),
        (
            {"quantities": (ObservedQuantity("delivered", "", ""),)},
            "those of 'volery' both define the quantity 'deliver",
        ),
    ],
)
def test_a_wrong_declaration_names_the_package(added, wrong, complaint):
    added("mine", type("Mine", (Counting,), wrong))
    with pytest.raises(UsageError, match=r"the observables 'mine'.*uninstall") as caught:
        all_observables()
    assert complaint in str(caught.value)


def test_what_is_no_class_of_observables_is_refused(added):
    added("mine", "text")
    with pytest.raises(UsageError, match="'text' is no class derived from"):
        all_observables()


def test_a_table_with_too_few_cells_is_left_out(added):
    class Short(Counting):
        def table(self, at):
            return TableRecord(title="t", columns=["a", "b"], rows=[["x"]])

    added("short", Short)
    record = Accounts(RunSetup()).record("completed")
    assert record.added["short"].table is None
    assert "a row of the table 't' has not 2 cells" in record.warnings[0]
