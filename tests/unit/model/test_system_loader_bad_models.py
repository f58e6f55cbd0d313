"""Whatever can be wrong with a model: the message names file, line, path, the fault and what would do."""

import re

import pytest

from volery.base.errors import ModelError, UsageError
from volery.model.system_loader import load
from volery.model.text import CollectedModelError

# what is spoilt: (old text, new text), a text in the line to blame, the path, and pieces of the complaint
SPOILT = {
    "typo in a key": (
        ("environment:\n", "enviroment:\n"),
        "enviroment:",
        "enviroment",
        ["unknown key (did you mean 'environment'?)", "valid here: allocations, application, chains"],
    ),
    "typo in a nested key": (
        ("drone_1}\n  networks", "drone_1, freqency: 3}\n  networks"),
        "onboard: {is",
        "platform.processors.onboard.freqency",
        ["unknown key (did you mean 'frequency'?)", "carried_by, context_switch, cores, frequency, is"],
    ),
    "missing key": (
        ("{is: intel-i5-3470, frequency: 3000 MHz}", "{frequency: 3000 MHz}"),
        "ground: {frequency",
        "platform.processors.ground.is",
        ["this key is missing"],
    ),
    "a zone that encloses nothing": (
        (
            "prison: {centre: {east: 50 m, north: 50 m}, radius: 20 m,",
            "prison: {corners: [{east: 1 m, north: 1 m}, {east: 9 m, north: 5 m}, {east: 5 m, north: 3 m}],",
        ),
        "prison: {",
        "environment.no_fly_zones.prison",
        ["its corners lie on one line and enclose nothing"],
    ),
    "a zone whose sides cross": (
        (
            "prison: {centre: {east: 50 m, north: 50 m}, radius: 20 m,",
            "prison: {corners: [{east: 0 m}, {east: 9 m, north: 9 m}, {east: 9 m}, {north: 9 m}],",
        ),
        "prison: {",
        "environment.no_fly_zones.prison",
        ["its sides from corner 1 to 2 and 3 to 4 cross; give the corners in order around it"],
    ),
    "no version": (("volery: 1\n", ""), "name: hosp", "volery", ["this key is missing"]),
    "another version": (("volery: 1\n", "volery: 2\n"), "volery: 2", "volery", ["2 is not one of 1"]),
    "text for a number": (
        ("priority: 10", "priority: high"),
        "priority: high",
        "components.drone_control.active.priority",
        ["a whole number is expected, not 'high'"],
    ),
    "number for a text": (
        ("name: hospital-delivery", "name: 5"),
        "name: 5",
        "name",
        ["text is expected, not 5"],
    ),
    "list for a mapping": (
        ("  workload: {requesters: 3, orders: {rate: 6 / h, count: 3, seed: orders}}", "  workload: [3]"),
        "workload: [3]",
        "environment.workload",
        ["a mapping of keys is expected, not a list"],
    ),
    "nothing for a mapping": (
        ("platform:\n  processors:", "platform:\nplatforms:\n  processors:"),
        "platform:",
        "platform",
        ["a mapping of keys is expected, not nothing"],
    ),
    "a name with a blank": (
        ("    rover_1: {", "    rover 1: {"),
        "rover 1",
        "environment.vehicles.rover 1",
        ["'rover 1' is no name"],
    ),
    "another dimension": (
        ("latency: 20 ms", "latency: 20 kg"),
        "latency: 20 kg",
        "platform.networks.radio.latency",
        ["'20 kg' is a mass", "a time such as 2 ms, 1.5 s or 15 min is expected"],
    ),
    "no unit": (
        ("latency: 20 ms", "latency: 20"),
        "latency: 20",
        "platform.networks.radio.latency",
        ["'20' is a number without a unit", "a time such as"],
    ),
    "unknown unit": (
        ("latency: 20 ms", "latency: 20 msec"),
        "latency: 20",
        "platform.networks.radio.latency",
        ["there is no unit 'msec'"],
    ),
    "a negative time": (
        ("latency: 20 ms", "latency: -20 ms"),
        "latency: -20",
        "platform.networks.radio.latency",
        ["-20 ms is too little: at least 0 s"],
    ),
    "a loss beyond all": (
        ("loss: 0.5 %", "loss: 120 %"),
        "loss: 120",
        "platform.networks.radio.loss",
        ["120 % is too much: at most 0.99"],
    ),
    "coordinates off the globe": (
        ("hospital: {latitude: 43.471", "hospital: {latitude: 143.471"),
        "hospital: {latitude: 143",
        "environment.places.hospital.latitude",
        ["143.471 is off the globe: -90 to 90 degrees"],
    ),
    "half an origin": (
        ("origin: {latitude: 43.47, longitude: -3.8, ", "origin: {latitude: 43.47, "),
        "origin: {latitude",
        "environment.origin.longitude",
        ["this key is missing"],
    ),
    "component figures at an unknown processor": (
        ("at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}", "at: {processor: z80, frequency: 1 MHz}"),
        "at: {processor: z80",
        "components.RouteGenerator.at.processor",
        ["no processor in the catalogue named 'z80'"],
    ),
    "unknown language": (
        ("language: rospy", "language: rosyp"),
        "language: rosyp",
        "components.drone_control.language",
        ["'rosyp' is not one of", "(did you mean 'rospy'?)"],
    ),
    "unknown processor": (
        ("is: intel-i5-3470", "is: intel-i5-3740"),
        "is: intel-i5-3740",
        "platform.processors.ground.is",
        [
            "no processor in the catalogue named 'intel-i5-3740' (did you mean 'intel-i5-3470'?)",
            "rpi4-cortex-a72",
        ],
    ),
    "frequency out of range": (
        ("frequency: 1500 MHz, carried_by", "frequency: 2.4 GHz, carried_by"),
        "2.4 GHz",
        "platform.processors.onboard.frequency",
        ["2400 MHz is outside what is known of rpi4-cortex-a72: 600 to 1500 MHz"],
    ),
    "figure at an unknown processor": (
        ("at: {processor: intel-i5-3470, frequency: 3 GHz}", "at: {processor: z80, frequency: 3 GHz}"),
        "z80",
        "components.DeliveryCentral.operations.order.at.processor",
        ["no processor in the catalogue named 'z80'"],
    ),
    "figure without a processor": (
        (", at: {processor: intel-i5-3470, frequency: 3 GHz}", ""),
        "order: {time: 2 ms",
        "components.DeliveryCentral.operations.order",
        ["a time means nothing without where it was taken"],
    ),
    "figure of an operation that is not provided": (
        ("operations: {order: {", "operations: {odrer: {"),
        "odrer",
        "components.DeliveryCentral.operations.odrer",
        ["no operation of its provided ports named 'odrer' (did you mean 'order'?)"],
    ),
    "too many cores": (
        ("is: intel-i5-3470, ", "is: intel-i5-3470, cores: 64, "),
        "cores: 64",
        "platform.processors.ground.cores",
        ["intel-i5-3470 has 4 cores, not 64"],
    ),
    "carried by an unknown vehicle": (
        ("carried_by: drone_1", "carried_by: drone_9"),
        "drone_9",
        "platform.processors.onboard.carried_by",
        ["no vehicle named 'drone_9'"],
    ),
    "a network to nowhere": (
        ("between: [ground, onboard]", "between: [ground, onbord]"),
        "onbord",
        "platform.networks.radio.between.1",
        ["no processor named 'onbord' (did you mean 'onboard'?)"],
    ),
    "a network to itself": (
        ("between: [ground, onboard]", "between: [ground, ground]"),
        "between: [ground, ground]",
        "platform.networks.radio.between",
        ["a processor stands here twice"],
    ),
    "unknown interface": (
        ("provides: {paths: Routing}", "provides: {paths: Rooting}"),
        "Rooting",
        "components.RouteGenerator.provides.paths",
        ["no interface named 'Rooting' (did you mean 'Routing'?)"],
    ),
    "providing what a vehicle provides": (
        ("provides: {paths: Routing}", "provides: {paths: Drone}"),
        "provides: {paths: Drone}",
        "components.RouteGenerator.provides.paths",
        ["Drone is provided by a vehicle, not by a component"],
    ),
    "taking a vehicle's interface name": (
        ("  DroneService: {deliver: {}}", "  DroneService: {deliver: {}}\n  Drone: {fly: {}}"),
        "  Drone: {fly",
        "interfaces.Drone",
        ["Drone is there in every model"],
    ),
    "unknown component": (
        ("is: RouteGenerator", "is: RouteGenerater"),
        "RouteGenerater",
        "application.planner.is",
        ["no component named 'RouteGenerater' (did you mean 'RouteGenerator'?)"],
    ),
    "unknown port": (
        ("routes: planner.paths", "route: planner.paths"),
        "route: planner",
        "application.central.route",
        ["no required port of DeliveryCentral named 'route' (did you mean 'routes'?)", "drones or routes"],
    ),
    "unconnected port": (
        ("routes: planner.paths, ", ""),
        "central: {is: DeliveryCentral",
        "application.central",
        ["the required port 'routes' is not connected; Routing is provided by planner.paths"],
    ),
    "connected to an unknown instance": (
        ("routes: planner.paths", "routes: planer.paths"),
        "planer.paths",
        "application.central.routes",
        ["no component instance named 'planer' (did you mean 'planner'?)"],
    ),
    "connected to an unknown port": (
        ("routes: planner.paths", "routes: planner.path"),
        "planner.path,",
        "application.central.routes",
        ["'planner.path' is no provided port; planner has planner.paths"],
    ),
    "interface mismatch": (
        ("routes: planner.paths", "routes: control.service"),
        "routes: control.service",
        "application.central.routes",
        ["control.service provides DroneService, not Routing (it has no get_path); Routing is provided by"],
    ),
    "a list for one port": (
        ("routes: planner.paths", "routes: [planner.paths, planner.paths]"),
        "[planner.paths",
        "application.central.routes",
        ["one Routing is required here; for a list, require Routing[]"],
    ),
    "connecting a topic port": (
        ("drone: drone_1, active", "drone: drone_1, progress: planner.paths, active"),
        "progress: planner.paths",
        "application.control.progress",
        ["Progress has no operations: it is publish and subscribe"],
    ),
    "unknown vehicle": (
        ("drone: drone_1", "drone: drone_2"),
        "drone: drone_2",
        "application.control.drone",
        ["no vehicle named 'drone_2' (did you mean 'drone_1'?)"],
    ),
    "a rover for a drone": (
        ("drone: drone_1", "drone: rover_1"),
        "drone: rover_1",
        "application.control.drone",
        ["rover_1 is a rover; Drone is provided by drone_1"],
    ),
    "unallocated component": (
        ("{central: ground, planner: ground, control: onboard}", "{central: ground, planner: ground}"),
        "  fast: {central",
        "allocations.fast",
        ["allocation 'fast' does not say where control runs"],
    ),
    "allocation to nowhere": (
        ("control: onboard}", "control: onbord}"),
        "control: onbord",
        "allocations.fast.control",
        [
            "no processor, operating system or memory space named 'onbord' (did you mean 'onboard'?)",
            "there is ground or onboard",
        ],
    ),
    "allocating something unknown": (
        ("control: onboard}", "control: onboard, centrall: ground}"),
        "centrall",
        "allocations.fast.centrall",
        ["no component instance or vehicle named 'centrall' (did you mean 'central'?)"],
    ),
    "allocating the environment": (
        ("control: onboard}", "control: onboard, requester: ground}"),
        "requester: ground",
        "allocations.fast.requester",
        ["requester belongs to the environment: it runs nowhere and costs nothing"],
    ),
    "no network between callers": (
        ("between: [ground, onboard]", "between: [ground, spare]"),
        "central: {is",
        "application.central.drones",
        ["central on ground calls control on onboard: no network joins them"],
    ),
    "an allocation that extends nothing": (
        ("extends: fast", "extends: fats"),
        "extends: fats",
        "allocations.slow.extends",
        ["no allocation named 'fats' (did you mean 'fast'?)"],
    ),
    "unknown autopilot": (
        ("kind: multirotor, autopilot: ardupilot", "kind: multirotor, autopilot: ardupliot"),
        "ardupliot",
        "environment.vehicles.drone_1.autopilot",
        ["no autopilot named 'ardupliot' (did you mean 'ardupilot'?)"],
    ),
    "unknown place": (
        ("at: port_north", "at: port_nord"),
        "port_nord",
        "environment.vehicles.drone_1.at",
        ["no place named 'port_nord' (did you mean 'port_north'?)"],
    ),
    "half a point": (
        ("at: port_north", "at: {latitude: 43.47}"),
        "{latitude: 43.47}",
        "environment.vehicles.drone_1.at",
        ["a point is {east, north} from the origin, {latitude, longitude}, or the name of a place"],
    ),
    "a start on another continent": (
        ("at: port_north", "at: {latitude: -43.47, longitude: 3}"),
        "{latitude: -43.47",
        "environment.vehicles.drone_1.at",
        ["km from the origin; at most 100 km make sense"],
    ),
    "one name for two": (
        ("    requester: {is: Requester", "    central: {is: Requester"),
        "central: {is: Requester",
        "environment.components.central",
        ["'central' is already a component instance"],
    ),
    "a reserved name": (
        ("    rover_1: {kind: rover", "    application: {kind: rover"),
        "application: {kind: rover",
        "environment.vehicles.application",
        ["'application' is already a word of the model"],
    ),
    "unknown fault": (
        ("  workload:", "  faults: {f: {kind: meteor, vehicle: drone_1, at: 5 s}}\n  workload:"),
        "meteor",
        "environment.faults.f.kind",
        ["no kind of fault named 'meteor'", "barometer-stuck, battery-cell-dead"],
    ),
    "fault with an argument of another kind": (
        ("  workload:", "  faults: {f: {kind: gps-lost, vehicle: drone_1, at: 5 s, motor: 2}}\n  workload:"),
        "gps-lost",
        "environment.faults.f.motor",
        ["unknown key; valid here: at, duration, kind or vehicle"],
    ),
    "fault with an argument out of range": (
        (
            "  workload:",
            "  faults: {f: {kind: motor-dead, vehicle: drone_1, at: 5 s, motor: 5}}\n  workload:",
        ),
        "motor-dead",
        "environment.faults.f.motor",
        ["the vehicle has 4 motors, no motor 5"],
    ),
    "fault of an unknown computer": (
        ("  workload:", "  faults: {f: {kind: computer-stopped, processor: bord, at: 5 s}}\n  workload:"),
        "computer-stopped",
        "environment.faults.f.processor",
        ["no processor named 'bord'", "ground or onboard"],
    ),
    "a motor of a rover": (
        ("  workload:", "  faults: {f: {kind: motor-dead, vehicle: rover_1, at: 5 s}}\n  workload:"),
        "motor-dead",
        "environment.faults.f.vehicle",
        ["no multirotor named 'rover_1'", "there is drone_1"],
    ),
    "a fault without a time": (
        ("  workload:", "  faults: {f: {kind: wind}}\n  workload:"),
        "{kind: wind}",
        "environment.faults.f.at",
        ["this key is missing"],
    ),
    "unknown observable": (
        ("drone_1.landing_offset", "drone_1.landing_ofset"),
        "landing_ofset",
        "requirements.landing.observe",
        ["no quantity of a vehicle named 'landing_ofset' (did you mean 'landing_offset'?)", "battery_min"],
    ),
    "observing something unknown": (
        ("drone_1.landing_offset", "drone_3.landing_offset"),
        "drone_3",
        "requirements.landing.observe",
        ["no subject to observe named 'drone_3' (did you mean 'drone_1'?)", "application"],
    ),
    "a bound in another unit": (
        ("max: 30 cm", "max: 30 s"),
        "max: 30 s",
        "requirements.landing.max",
        ["drone_1.landing_offset is measured in m", "'30 s' is a time", "a bound such as 0.5 m is expected"],
    ),
    "a bound without a unit": (
        ("max: 30 cm", "max: 0.3"),
        "max: 0.3",
        "requirements.landing.max",
        ["drone_1.landing_offset is measured in m", "'0.3' is a number without a unit"],
    ),
    "a unit on a count": (
        ("deadline_misses, max: 0", "deadline_misses, max: 3 s"),
        "max: 3 s",
        "requirements.control.max",
        ["control.deadline_misses is a plain number", "'3 s' is a time"],
    ),
    "no bound": (
        (", max: 30 cm", ""),
        "landing: {observe",
        "requirements.landing",
        ["give exactly one of max and min"],
    ),
    "two bounds": (
        ("max: 30 cm", "max: 30 cm, min: 1 cm"),
        "min: 1 cm",
        "requirements.landing",
        ["give exactly one of max and min"],
    ),
    "a missing world file": (
        ("world: city.yaml", "world: town.yaml"),
        "town.yaml",
        "environment.world",
        ["there is no file 'town.yaml'", "city.yaml, model.yaml"],
    ),
    "the same key twice": (
        ("name: hospital-delivery\n", "name: hospital-delivery\nname: other\n"),
        "name: other",
        "name",
        ["this key is here twice; first in line 2"],
    ),
    "not YAML": (
        ("name: hospital-delivery", "name: [hospital"),
        "interfaces:",
        "",
        ["this is not YAML", "expected ',' or ']'"],
    ),
    "brackets within braces": (
        ('drones: "DroneService[]"', "drones: DroneService[]"),
        "drones: DroneService[]",
        "",
        ["this is not YAML", 'put quotes around "Type[]"'],
    ),
    "a parameter called like a port": (
        ("parameters: {steps: 4}", "parameters: {drone: 4}"),
        "parameters: {drone: 4}",
        "application.control.parameters.drone",
        ["'drone' is a required port of drone_control; a parameter needs another name"],
    ),
    "a tab": (("name: hospital-delivery", "\tname: x"), "\tname", "", ["this is not YAML", "'\\t'"]),
}


@pytest.mark.parametrize("case", SPOILT, ids=lambda case: case.replace(" ", "-"))
def test_a_message_names_line_path_and_remedy(workshop, case):
    (old, new), blamed, path, pieces = SPOILT[case]
    workshop.change(old, new, "model.yaml" if old in workshop.file.read_text() else "city.yaml")
    file = "model.yaml" if blamed in workshop.file.read_text() else "city.yaml"
    with pytest.raises(ModelError) as caught:
        workshop.load()
    errors = caught.value.errors if isinstance(caught.value, CollectedModelError) else (caught.value,)
    wanted = f"{workshop.folder / file}:{workshop.line_of(blamed, file)}: " + (f"{path}: " if path else "")
    blaming = [str(error) for error in errors if str(error).startswith(wanted)]
    assert blaming, f"nothing starts with {wanted!r}:\n{caught.value}"
    assert any(all(piece in error for piece in pieces) for error in blaming), caught.value


def test_several_problems_are_reported_at_once_in_the_order_of_the_file(workshop):
    workshop.change("routes: planner.paths", "routes: planer.paths").change("max: 30 cm", "max: 30 s")
    workshop.change("autopilot: ardupilot, at: store", "autopilot: px5, at: store")
    with pytest.raises(CollectedModelError, match="3 things are wrong with this model") as caught:
        workshop.load()
    lines = [error.where.line for error in caught.value.errors]
    assert lines == sorted(lines)
    assert [error.path for error in caught.value.errors] == [
        "application.central.routes",
        "environment.vehicles.rover_1.autopilot",
        "requirements.landing.max",
    ]


def test_a_cycle_of_required_ports_is_named(workshop):
    workshop.change("requires: {map: Environment}", "requires: {map: Environment, back: Delivery}")
    workshop.change("map: environment}", "map: environment, back: central.orders}")
    with pytest.raises(
        ModelError, match=r"a cycle of required ports: (central -> planner -> central|planner -> cent)"
    ):
        workshop.load()


def test_a_component_that_requires_itself_is_a_cycle(workshop):
    workshop.change("requires: {map: Environment}", "requires: {map: Environment, self: Routing}")
    workshop.change("map: environment}", "map: environment, self: planner.paths}")
    with pytest.raises(ModelError, match="a cycle of required ports: planner -> planner"):
        workshop.load()


@pytest.mark.parametrize("kind", ["allocations", "scenarios"])
def test_extending_in_a_circle_is_named(workshop, kind):
    workshop.change("  fast: {central", "  fast: {extends: slow, central")
    workshop.change("  calm: {set", "  calm: {extends: pocket, set")
    names = {"allocations": "slow -> fast -> slow", "scenarios": "pocket -> calm -> pocket"}
    with pytest.raises(ModelError, match=f"a circle: {names[kind]}"):
        workshop.load(*(("pocket", None) if kind == "scenarios" else (None, "slow")))


def test_a_model_without_an_allocation(workshop):
    text = workshop.file.read_text()
    start, end = text.index("allocations:"), text.index("environment:")
    workshop.file.write_text(text[:start] + text[end:])
    with pytest.raises(ModelError, match="this model has no allocation and does not say where central runs"):
        workshop.load()


def test_two_carried_computers_need_an_allocation(workshop):
    workshop.change(
        "  networks:\n",
        "    second: {is: rpi4-cortex-a72, frequency: 1 GHz, carried_by: drone_1}\n  networks:\n",
    )
    with pytest.raises(
        ModelError, match="it carries onboard and second: the allocation must say where its node runs"
    ):
        workshop.load()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "the file is empty"),
        ("# only words\n", "the file is empty"),
        ("- a\n- b\n", "a model is a mapping that starts with `volery: 1`"),
        ("just words\n", "a model is a mapping"),
        ("a: &x [*x]\n", "an alias that contains itself"),
        ("a: {<<: {b: 1}}\n", "merge keys"),
        ("? [a]\n: b\n", "a key must be a word"),
        ("a: 1\n---\nb: 2\n", "expected a single document"),
        ("a: *nobody\n", "found undefined alias 'nobody'"),
        ("[" * 5000, "nested too deeply"),
        ("a: !!int abc\n", "'abc' is no number"),
        (f"volery: 0x{'f' * 10**6}\n", "a number of 1000002 characters"),
        (f"volery: {'1' * 10**6}\n", "a number of 1000000 characters"),
    ],
)
def test_texts_that_are_no_models(workshop, text, complaint):
    workshop.file.write_text(text)
    with pytest.raises(ModelError) as caught:
        workshop.load()
    assert complaint in str(caught.value)
    assert str(caught.value).startswith(str(workshop.file))


def test_a_value_of_a_megabyte_is_not_repeated_in_the_message(workshop):
    workshop.file.write_text(f"volery: {'x' * 10**6}\n")
    with pytest.raises(ModelError, match=r"x… \(1000002 characters\)") as caught:
        workshop.load()
    assert len(str(caught.value)) < 2000


@pytest.mark.parametrize("path", ["/etc/passwd", "../../../../../../../../etc/passwd"])
def test_a_file_outside_the_folder_of_the_model_is_not_used(workshop, path):
    text = workshop.file.read_text()
    workshop.file.write_text(re.sub(r"path: \S+\.py", f"path: {path}", text, count=1))
    assert path in workshop.file.read_text()
    with pytest.raises(ModelError, match="is outside the folder of the model; list its folder under"):
        workshop.load()


def test_a_bomb_of_aliases_is_refused(workshop):
    levels = "\n".join(f"a{n + 1}: &a{n + 1} [{', '.join([f'*a{n}'] * 10)}]" for n in range(9))
    workshop.file.write_text(f"a0: &a0 [x]\n{levels}\n")
    with pytest.raises(ModelError, match="more than 100000 values"):
        workshop.load()


def test_a_missing_file(workshop):
    with pytest.raises(
        ModelError, match=r"there is no file '.*modle.yaml'; in that folder there is city.yaml, model.yaml"
    ):
        load(workshop.folder / "modle.yaml", workshop.vocabulary)


def test_a_file_that_is_not_text(workshop):
    workshop.file.write_bytes(b"\xff\xfe\x00volery")
    with pytest.raises(ModelError, match="is not text"):
        workshop.load()


def test_a_world_file_holds_geography_only(workshop):
    workshop.change("origin:", "wind: 3 m/s\norigin:", "city.yaml")
    with pytest.raises(ModelError) as caught:
        workshop.load()
    assert f"{workshop.folder / 'city.yaml'}:1: environment.wind: a world file has no such key" in str(
        caught.value
    )


@pytest.mark.parametrize(
    ("option", "complaint"),
    [
        (
            "platform.processors.onbord.frequency=1 GHz",
            "no entry of platform.processors named 'onbord' (did you mean 'onboard'?)",
        ),
        ("enviroment.wind=1 m/s", "no key of a model named 'enviroment' (did you mean 'environment'?)"),
        ("platform.processors.onboard.freq=1 GHz", "no key of platform.processors.onboard named 'freq'"),
        ("platform.processors.onboard.frequency=2 kg", "'2 kg' is a mass"),
        (
            "platform.processors.onboard.frequency=5 GHz",
            "5000 MHz is outside what is known of rpi4-cortex-a72",
        ),
        ("platform.networks.radio.between.7=ground", "platform.networks.radio.between has positions 0 to 1"),
        ("name.first=x", "name is 'hospital-delivery': set all of it"),
        ("environment.wind=[", "this is not YAML"),
        ("application.central.routes=nobody.x", "no component instance named 'nobody'"),
    ],
)
def test_an_option_is_named_when_it_is_wrong(workshop, option, complaint):
    with pytest.raises(ModelError) as caught:
        workshop.load(None, None, option)
    assert str(caught.value).startswith(f"--set {option}: "), caught.value
    assert complaint in str(caught.value)


@pytest.mark.parametrize("option", ["nonsense", "=5", "a..b=5", ""])
def test_an_option_without_a_path_or_a_value(workshop, option):
    with pytest.raises(UsageError, match="a path and a value are expected"):
        workshop.load(None, None, option)


def test_a_wrong_end_of_a_scenario_is_reported_once_where_it_is_written(workshop):
    workshop.change("until: {observe: application.delivered, min: 1}", "until: 5 s")
    with pytest.raises(ModelError) as caught:
        workshop.load("pocket", None)
    assert not isinstance(caught.value, CollectedModelError)
    assert caught.value.path == "scenarios.pocket.until"


def test_a_value_that_is_used_twice_is_reported_once(workshop):
    workshop.change("carried_by: drone_1", "carried_by: drone_9")
    workshop.change(
        "at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}", "at: {processor: z80, frequency: 1 MHz}"
    )
    with pytest.raises(CollectedModelError) as caught:
        workshop.load()
    assert [error.path for error in caught.value.errors] == [
        "components.RouteGenerator.at.processor",
        "platform.processors.onboard.carried_by",
    ]
