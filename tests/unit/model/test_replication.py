"""`count: N` of a vehicle: the model has N of it and of what belongs to it, as if it were written by hand."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

from volery.base.errors import ModelError, UsageError
from volery.model.assembly import read_tree
from volery.model.system import System
from volery.model.system_loader import load
from volery.model.text import parse
from volery.model.writing import model_text

DRONE = """\
  control: {is: drone_control, drone: drone, active: {priority: 12}, parameters: {flies: drone}}
"""
DRONES = """\
  control_1: {is: drone_control, drone: drone_1, active: {priority: 12}, parameters: {flies: drone_1}}
  control_2: {is: drone_control, drone: drone_2, active: {priority: 7}, parameters: {flies: drone_2}}
  control_3: {is: drone_control, drone: drone_3, active: {priority: 12}, parameters: {flies: drone_3}}
"""
COUNTED = (
    (
        "  control: {is: drone_control, drone: drone_1, active: {priority: 12}, parameters: {steps: 4}}\n",
        DRONE + "  control_2: {active: {priority: 7}}\n",
    ),
    ("carried_by: drone_1}", "carried_by: drone}"),
    (
        "    drone_1: {kind: multirotor, autopilot: ardupilot, at: port_north, battery: 5 Ah, "
        "parameters: {WP_YAW: 1}}\n",
        "    drone: {count: 3, kind: multirotor, autopilot: ardupilot, at: [port_north, pad], \n"
        "      battery: 5 Ah, spacing: {east: 2 m, north: -1 m}}\n"
        "    drone_2: {battery: {charge: 0.5}}\n",
    ),
    ("control: onboard}", "control: vision, vision: onboard}"),
    ("allocations:\n", "memory_spaces:\n  vision: {memory: 8 MB}\nallocations:\n"),
    ("environment:\n", "chains: {seen: [/drone/camera, /goal]}\nenvironment:\n"),
    ("  workload:", "  faults: {gust: {kind: motor-dead, vehicle: drone, at: 5 s}}\n  workload:"),
    ("landing: {observe: drone_1.landing_offset", "landing: {observe: drone.landing_offset"),
    ("radio: {between: [ground, onboard]", "radio: {between: [ground, onboard, base], per: drone"),
    ("planner: onboard,", "planner: onboard_1,"),
    ("onboard: {is", "base: {is: intel-i5-3470, frequency: 3 GHz}\n    onboard: {is"),
)
BY_HAND = (
    (COUNTED[0][1], DRONES),
    ("[control.service]", "[control_1.service, control_2.service, control_3.service]"),
    (
        "    onboard: {is: rpi4-cortex-a72, frequency: 1500 MHz, carried_by: drone}\n",
        "".join(
            f"    onboard_{i}: {{is: rpi4-cortex-a72, frequency: 1500 MHz, carried_by: drone_{i}}}\n"
            for i in (1, 2, 3)
        ),
    ),
    (
        COUNTED[2][1],
        "    drone_1: {kind: multirotor, autopilot: ardupilot, at: port_north, battery: 5 Ah}\n"
        "    drone_2: {kind: multirotor, autopilot: ardupilot, at: pad_2,\n"
        "      battery: {capacity: 5 Ah, charge: 0.5}}\n"
        "    drone_3: {kind: multirotor, autopilot: ardupilot, battery: 5 Ah,\n"
        "      at: {place: port_north, east: 2 m, north: -1 m}}\n",
    ),
    (
        "control: vision, vision: onboard}",
        ", ".join(f"control_{i}: vision_{i}, vision_{i}: onboard_{i}" for i in (1, 2, 3)) + "}",
    ),
    ("  vision: {memory: 8 MB}\n", "".join(f"  vision_{i}: {{memory: 8 MB}}\n" for i in (1, 2, 3))),
    (
        "seen: [/drone/camera, /goal]",
        ", ".join(f"seen_{i}: [/drone_{i}/camera, /goal]" for i in (1, 2, 3)),
    ),
    (
        "gust: {kind: motor-dead, vehicle: drone, at: 5 s}",
        ", ".join(f"gust_{i}: {{kind: motor-dead, vehicle: drone_{i}, at: 5 s}}" for i in (1, 2, 3)),
    ),
    (
        "  landing: {observe: drone.landing_offset, max: 30 cm}\n",
        "".join(f"  landing_{i}: {{observe: drone_{i}.landing_offset, max: 30 cm}}\n" for i in (1, 2, 3)),
    ),
    (
        "  control: {observe: control.deadline_misses, max: 0}\n",
        "".join(f"  control_due_{i}: {{observe: control_{i}.deadline_misses, max: 0}}\n" for i in (1, 2, 3)),
    ),
    (
        "    radio: {between: [ground, onboard, base], per: drone, bandwidth: 57600 bit/s, latency: 20 ms, "
        "loss: 0.5 %}\n",
        "".join(
            f"    radio_{i}: {{between: [ground, onboard_{i}, base], per: drone_{i}, "
            "bandwidth: 57600 bit/s, latency: 20 ms, loss: 0.5 %}\n"
            for i in (1, 2, 3)
        ),
    ),
)


@pytest.fixture
def counted(workshop):
    workshop.change("  store: {", "  pad: {east: 30 m, north: 2 m, per: drone}\n  store: {", "city.yaml")
    for old, new in COUNTED:
        workshop.change(old, new)
    return workshop.change("  control: {observe", "  control_due: {observe")


def _plain(system: System) -> dict[str, object]:
    found = {one.name: getattr(system, one.name) for one in fields(system)}
    return {key: one for key, one in found.items() if key not in ("sources", "folder")}


def test_it_is_the_model_that_is_written_by_hand(counted):
    found = _plain(counted.load())
    written = counted.change("  control_due: {observe", "  control: {observe")
    for old, new in BY_HAND:
        written.change(old, new)
    pads = "".join(f"  pad_{i}: {{east: {28 + 2 * i} m, north: {3 - i} m}}\n" for i in (1, 2, 3))
    written.change("  pad: {east: 30 m, north: 2 m, per: drone}\n", pads, "city.yaml")
    by_hand = _plain(written.load())
    for key, one in by_hand.items():
        assert found[key] == one, key


@pytest.mark.parametrize("count", [1, 3, 5])
def test_the_number_is_one_path(counted, count):
    system = counted.load(None, None, f"environment.vehicles.drone.count={count}")
    names = [f"drone_{i}" for i in range(1, count + 1)]
    assert [one.name for one in system.vehicles] == [*names, "rover_1"]
    drones = system.instance("central").connections["drones"].targets
    assert [str(one) for one in drones] == [f"control_{i}.service" for i in range(1, count + 1)]
    assert [one.carried_by for one in system.processors if one.carried_by] == names
    assert system.instance(f"control_{count}").processor == f"onboard_{count}"
    assert system.vehicles[count - 1].processor == f"onboard_{count}"


def test_copies_have_the_lines_of_what_they_were_made_of(counted):
    system = counted.load()
    assert system.instance("control_3").where.line == counted.line_of("  control: {is")
    assert system.vehicle("drone_3").where.line == counted.line_of("    drone: {count")
    assert system.requirements[1].where.line == counted.line_of("  landing: {")


def test_copies_stand_beside_one_another(counted):
    counted.change("at: [port_north, pad]", "at: store").change("spacing: {east: 2 m, north: -1 m}", "")
    stands = [(one.at.east_m, one.at.north_m) for one in counted.load().vehicles[:3]]
    assert stands == [(0.0, 0.0), (3.0, 0.0), (6.0, 0.0)]


@pytest.mark.parametrize("moved", ["{place: store, east: 3 m}", "{east: 3 m}", "store"])
def test_a_point_may_be_metres_from_a_place(workshop, moved):
    place = workshop.change("at: store", f"at: {moved}").load().vehicle("rover_1").at
    assert (place.east_m, place.north_m) == (3.0 if "3 m" in moved else 0.0, 0.0)


def test_a_change_sets_all_copies_or_one(counted):
    changes = ("environment.vehicles.drone_3.battery.charge=0.25", "platform.processors.onboard.cores=2")
    changes += ("application.control_1.parameters.flies=nothing", "requirements.landing_2=")
    system = counted.load(None, None, *changes)
    assert [one.battery.charge for one in system.vehicles[:3]] == [1.0, 0.5, 0.25]
    assert [one.cores for one in system.processors if one.carried_by] == [2, 2, 2]
    flies = [system.instance(f"control_{i}").parameters["flies"] for i in (1, 2, 3)]
    assert flies == ["nothing", "drone_2", "drone_3"]
    assert [one.name for one in system.requirements][:2] == ["landing_1", "landing_3"]
    with pytest.raises(ModelError, match=r"no entry of environment\.vehicles named 'drone_4'"):
        counted.load(None, None, "environment.vehicles.drone_4.battery.charge=0.25")


def test_an_instance_that_names_no_vehicle_says_per(counted):
    counted.change("  planner: {is: RouteGenerator,", "  planner: {is: RouteGenerator, per: drone,")
    counted.change("routes: planner.paths,", "routes: planner_2.paths,")
    counted.change("planner: onboard_1,", "planner: onboard,")
    system = counted.load(None, "slow")
    assert [one.name for one in system.instances if one.component.name == "RouteGenerator"] == [
        "planner_1",
        "planner_2",
        "planner_3",
    ]
    assert system.instance("planner_3").per == "drone_3"
    assert system.instance("planner_3").processor == "onboard_3"


WRONG = [
    ("count: 3", "count: 0", "a whole number from 1 to 1000 is expected, not 0", "drone: {count"),
    ("count: 3", "count: three", "not 'three'", "drone: {count"),
    ("at: [port_north, pad]", "at: [port_north, pond]", "no place named 'pond'", "drone: {count"),
    (
        "kind: multirotor",
        "kind: kite",
        "environment.vehicles.drone.kind: 'kite' is not one of",
        "drone: {cou",
    ),
    ("east: 2 m, north", "east: 2 kg, north", "a length such as", "spacing: {"),
    ("east: 2 m, north", "up: 2 m, north", "no key of a spacing named 'up'", "spacing: {"),
    ("drone: drone, active", "drone: dron, active", "no vehicle named 'dron'", "  control: {is"),
    (
        "{flies: drone}",
        "{drone: 1, flies: drone}",
        "application.control.parameters.drone: 'drone' is a req",
        "  control: {is",
    ),
    ("drone_2: {battery: {charge: 0.5}}", "drone_2: {battry: 1 Ah}", "unknown key (did", "drone_2: {"),
    (
        "central: ground",
        "central: onboard",
        "there is one onboard for each drone: state `per: drone`",
        "fast:",
    ),
    ("carried_by: drone}", "carried_by: drone, per: dron}", "no vehicle named 'dron'", "    onboard: {is"),
    (", per: drone}", ", per: dron}", "no vehicle named 'dron'", "pad: {"),
    ("at: store", "count: 2, at: pad", "there is one for each rover_1, and it names something", "rover_1: {"),
]


@pytest.mark.parametrize(("old", "new", "complaint", "line"), WRONG, ids=[one[1] for one in WRONG])
def test_what_is_wrong_is_reported_at_the_line_it_stands_in(counted, old, new, complaint, line):
    name = "city.yaml" if line == "pad: {" else "model.yaml"
    with pytest.raises((ModelError, UsageError)) as caught:
        counted.change(old, new, name).load()
    errors = [one for one in getattr(caught.value, "errors", [caught.value]) if complaint in str(one)]
    assert errors, str(caught.value)
    assert errors[0].where.line == counted.line_of(line, name)


def test_a_tree_for_other_tools_states_the_copies(counted):
    counted.change("scenarios:\n", "scenarios:\n  few: {set: {environment.vehicles.drone.count: 1}}\n")
    plain = read_tree(counted.file).plain()
    assert list(plain["environment"]["vehicles"]) == ["drone_1", "drone_2", "drone_3", "rover_1"]
    assert plain["allocations"]["slow"]["set"] == {
        f"platform.processors.onboard_{i}.frequency": "600 MHz" for i in (1, 2, 3)
    }
    assert plain["scenarios"]["few"]["set"] == {}
    copied = counted.folder / "copied.yaml"
    copied.write_text(model_text(plain))
    again = load(copied, counted.vocabulary)
    assert _plain(replace(again, provenances={})) == _plain(replace(counted.load(), provenances={}))
    assert parse(copied.read_text(), "copied.yaml").at(("environment", "world")) is None
