"""A right model arrives as frozen data in SI units, with everything inherited and overridden settled."""

from dataclasses import replace
from math import hypot, isclose
from pathlib import Path

import pytest

from volery.base.errors import ModelError, UsageError
from volery.base.time import MS, S
from volery.model.components import Activity, StatedAt, StatedFigure
from volery.model.faults import MotorDead
from volery.model.instances import ConnectionTarget, PortConnection, TargetKind
from volery.model.reading import ProcessorKind
from volery.model.system import Chain
from volery.model.system_loader import load


def test_units_are_si_and_times_nanoseconds(workshop):
    system = workshop.load()
    network = system.network_between("onboard", "ground")
    assert (network.bandwidth_bit_s, network.latency_ns, network.loss) == (57600.0, 20 * MS, 0.005)
    assert system.processor("ground").frequency_hz == 3e9
    assert system.processor("ground").frequency_mhz == 3000
    assert system.vehicle("drone_1").battery.capacity_coulomb == 18000.0
    assert system.environment.workload.rate_hz == pytest.approx(6 / 3600)
    assert system.requirements[0].bound == 0.3
    assert system.limits.duration_ns == 900 * S


def test_cores_come_from_the_catalogue_unless_stated(workshop):
    assert workshop.load().processor("ground").cores == 4
    assert workshop.load(None, None, "platform.processors.ground.cores=2").processor("ground").cores == 2


def test_a_processor_may_be_loaded_and_switching_may_cost(workshop):
    assert (
        workshop.load().processor("ground").load,
        workshop.load().processor("ground").context_switch_ns,
    ) == (
        0.0,
        0,
    )
    changes = ("platform.processors.ground.load=20 %", "platform.processors.ground.context_switch=5 us")
    ground = workshop.load(None, None, *changes).processor("ground")
    assert ground.load == pytest.approx(0.2)
    assert ground.context_switch_ns == 5000


def test_a_chain_of_topics_can_be_observed(workshop):
    changes = (
        "chains.sight=[/camera, /set_point]",
        "requirements.quick={observe: sight.latency_p95, max: 80 ms}",
    )
    system = workshop.load(None, None, *changes)
    assert system.chains == (Chain("sight", ("/camera", "/set_point")),)
    assert system.requirements[-1].bound == pytest.approx(0.08)
    with pytest.raises(ModelError, match="full name, such as '/camera'"):
        workshop.load(None, None, "chains.sight=[camera]")


def test_ports_are_connected(workshop):
    system = workshop.load()
    drones = system.instance("central").connections["drones"]
    assert drones == PortConnection(
        "drones", "DroneService", (ConnectionTarget(TargetKind.INSTANCE, "control", "service"),), many=True
    )
    assert system.instance("control").connections["drone"].targets == (
        ConnectionTarget(TargetKind.VEHICLE, "drone_1"),
    )
    assert str(system.instance("planner").connections["map"].targets[0]) == "environment"
    assert "progress" not in system.instance("control").connections


def test_an_instance_overrides_its_component(workshop):
    control = workshop.load().instance("control")
    assert control.activity == Activity(100 * MS, 80 * MS, 12, 0)
    assert control.parameters["steps"] == 4


def test_parameters_with_a_unit_become_numbers_unless_quoted(workshop):
    parameters = workshop.load().instance("control").parameters
    assert parameters["rate"] == pytest.approx(6 / 3600)
    assert parameters["label"] == "10 m"
    assert parameters["points"] == (1000.0, "x")


def test_a_period_is_the_deadline_where_none_is_stated(workshop):
    workshop.change(", deadline: 80 ms", "")
    assert workshop.load().instance("control").activity.deadline_ns == 100 * MS


def test_figures_stand_at_a_processor(workshop):
    operations = workshop.load().components["RouteGenerator"].operations
    assert [(figure.time_ns, figure.processor) for figure in operations["get_path"]] == [
        (5 * MS, "rpi4-cortex-a72"),
        (1 * MS, "intel-i5-3470"),
    ]
    order = workshop.load().components["DeliveryCentral"].operations["order"][0]
    assert order == StatedFigure(2 * MS, StatedAt("intel-i5-3470", 3e9), 0.003, "estimated")


def test_the_class_is_the_components_name_in_camel_case(workshop):
    components = workshop.load().components
    assert components["drone_control"].class_name == "DroneControl"
    assert components["DeliveryCentral"].class_name == "DeliveryCentral"


def test_environment_components_run_nowhere(workshop):
    system = workshop.load()
    assert system.instance("requester").is_environment
    assert [instance.name for instance in system.instances] == ["central", "planner", "control", "requester"]


def test_every_point_is_in_degrees_and_metres(workshop):
    environment = workshop.load().environment
    hospital, port = environment.places["hospital"], environment.places["port_north"]
    assert environment.origin.from_enu((hospital.east_m, hospital.north_m, 0.0))[0] == pytest.approx(43.471)
    assert environment.origin.to_enu(port.latitude, port.longitude, 20.0)[1] == pytest.approx(100.0)
    assert port.position.altitude.metres == 20.0
    assert [place.name for place in environment.places_with("port")] == ["port_north"]


def test_ways_are_edges_with_lengths(workshop):
    environment = workshop.load().environment
    assert environment.roads.edges[0] == ("store", "bend", hypot(5, 5))
    assert list(environment.roads.nodes) == ["store", "port_north", "bend"]
    assert environment.corridors.height_m == 40.0


def test_a_circle_becomes_a_polygon_around_it(workshop):
    prison = workshop.load().environment.no_fly_zones[0]
    distances = [hypot(east - 50, north - 50) for east, north in prison.corners]
    middles = [
        hypot((a[0] + b[0]) / 2 - 50, (a[1] + b[1]) / 2 - 50)
        for a, b in zip(prison.corners, prison.corners[1:], strict=False)
    ]
    assert min(distances) > 20.0
    assert all(isclose(middle, 20.0, rel_tol=1e-9) for middle in middles)


def test_a_carried_computer_drains_its_carrier_and_serves_it(workshop):
    system = workshop.load()
    assert system.processor("onboard").powered_by == "drone_1"
    assert system.vehicle("drone_1").processor == "onboard"
    assert system.vehicle("rover_1").processor is None
    mains = workshop.load(None, None, "platform.processors.onboard.powered_by=mains")
    assert mains.processor("onboard").powered_by is None


def test_an_allocation_places_a_vehicles_node(workshop):
    workshop.change("control: onboard}", "control: onboard, rover_1: ground}")
    assert workshop.load().vehicle("rover_1").processor == "ground"


def test_the_first_allocation_is_the_default(workshop):
    assert workshop.load().allocation == "fast"
    slow = workshop.load(None, "slow")
    assert slow.processor("onboard").frequency_mhz == 600
    assert (slow.instance("planner").processor, slow.instance("central").processor) == ("onboard", "ground")
    assert slow.allocations == ("fast", "slow")


def test_a_scenario_changes_the_model_and_chooses_an_allocation(workshop):
    system = workshop.load("pocket")
    assert (system.scenario, system.allocation) == ("pocket", "slow")
    wind = system.environment.wind
    assert (wind.speed_m_s, wind.gusts_m_s) == (0.0, 1.0)
    assert system.limits.duration_ns == 60 * S
    assert (system.limits.until.observe, system.limits.until.relation) == ("application.delivered", "min")


def test_options_win_over_scenario_and_allocation(workshop):
    system = workshop.load(
        "pocket",
        "fast",
        "environment.wind.speed=7 m/s",
        "platform.processors.onboard.frequency=1 GHz",
        "allocations.fast.planner=onboard",
        "run.duration=5 s",
    )
    assert system.environment.wind.speed_m_s == 7.0
    assert system.processor("onboard").frequency_mhz == 1000
    assert system.instance("planner").processor == "onboard"
    assert system.limits.duration_ns == 5 * S
    assert system.overrides[0] == "environment.wind.speed=7 m/s"


def test_an_option_may_take_an_entry_away(workshop):
    system = workshop.load(None, None, "environment.vehicles.rover_1=")
    assert [vehicle.name for vehicle in system.vehicles] == ["drone_1"]


def test_the_world_file_may_be_chosen_by_an_option(workshop):
    (workshop.folder / "flat.yaml").write_text(
        "places: {port_north: {east: 1 m, north: 2 m}, store: {east: 0 m}}\n"
    )
    system = workshop.load(None, None, "environment.world=flat.yaml")
    assert system.environment.places["port_north"].east_m == 1.0
    assert [source.name for source in system.sources] == ["model.yaml", "flat.yaml"]


def test_the_models_own_places_win_over_the_world_files(workshop):
    workshop.change("  wind: 3 m/s\n", "  places: {store: {east: 7 m}}\n")
    places = workshop.load().environment.places
    assert places["store"].east_m == 7.0
    assert places["port_north"].north_m == 100.0


def test_the_sources_are_kept(workshop):
    sources = workshop.load().sources
    assert [source.name for source in sources] == ["model.yaml", "city.yaml"]
    assert sources[0].text == workshop.file.read_text()


def test_a_folder_stands_for_its_model(workshop):
    assert load(workshop.folder, workshop.vocabulary).name == "hospital-delivery"


def test_where_things_stand(workshop):
    control = workshop.load().instance("control")
    assert control.where == (str(workshop.file), workshop.line_of("control: {is: drone_control"))


def test_same_text_same_system(workshop):
    assert workshop.load() == workshop.load()


def test_ros_is_needed_by_a_language_or_a_topic_port(workshop):
    assert workshop.load().needs_ros
    workshop.change("language: rospy", "language: python").change(", progress: Progress", "")
    assert not workshop.load().needs_ros


def test_an_unknown_name_is_looked_up(workshop):
    with pytest.raises(UsageError, match=r"no vehicle named 'drone_2' \(did you mean 'drone_1'\?\)"):
        workshop.load().vehicle("drone_2")


def test_unknown_scenario_and_allocation_are_the_callers_fault(workshop):
    with pytest.raises(UsageError, match=r"no scenario named 'poket' \(did you mean 'pocket'\?\)"):
        workshop.load("poket")
    with pytest.raises(UsageError, match="no allocation named 'x'; there is fast or slow"):
        workshop.load(None, "x")


BOARD = "platform.processors.ground={is: rpi4-cortex-a72, frequency: %s MHz}"


@pytest.mark.parametrize("mhz", [600, 700, 1500])
def test_a_frequency_that_can_be_set_is_not_warned_of(workshop, mhz):
    assert workshop.load(None, None, BOARD % mhz).warnings == ()


def test_a_frequency_between_two_settings_is_a_warning_that_names_them(workshop):
    system = workshop.load(None, None, BOARD % 1450)
    assert system.processor("ground").frequency_mhz == 1450
    assert [str(one) for one in system.warnings] == [
        "platform.processors.ground.frequency: rpi4-cortex-a72 cannot be set to 1450 MHz; "
        "the nearest settings are 1400 and 1500 MHz",
    ]
    assert system.warnings[0].rule.code == "V404"


def test_a_processor_whose_settings_are_not_known_is_not_warned_of(workshop):
    board = "platform.processors.ground={is: intel-i5-3470, frequency: 1650 MHz}"
    assert workshop.load(None, None, board).warnings == ()


def test_a_catalogue_that_the_model_brings_along(workshop):
    def read_catalogue(file: Path):
        if file.name != "mine.yaml":
            raise ModelError(f"{file}: this catalogue cannot be read")
        return {"mine": ProcessorKind(2, 2.6e9, 2.6e9)}

    workshop.vocabulary = replace(workshop.vocabulary, read_catalogue=read_catalogue)
    board = "platform.processors.ground={is: mine, frequency: 2600 MHz}"
    system = workshop.load(None, None, board, "platform.catalogues=mine.yaml")
    assert system.processor("ground").kind == "mine"
    assert system.catalogues == (workshop.folder / "mine.yaml",)
    with pytest.raises(ModelError, match=r"no processor in the catalogue.*'mine'"):
        workshop.load(None, None, board)
    with pytest.raises(ModelError, match=r"platform\.catalogues.*cannot be read"):
        workshop.load(None, None, "platform.catalogues=[gone.yaml]")


def test_a_fault_is_read_with_its_arguments_and_defaults(workshop):
    workshop.change(
        "  workload:",
        "  faults:\n"
        "    weak: {kind: motor-dead, vehicle: drone_1, at: 5 s, thrust: 60 %}\n"
        "    front: {kind: wind, at: 1 min, duration: 20 s, speed: 36 km/h}\n"
        "  workload:",
    )
    weak, front = workshop.load().environment.faults
    assert weak == MotorDead(name="weak", at_ns=5 * S, vehicle="drone_1", motor=1, thrust=0.6)
    assert (front.speed_m_s, front.direction_deg, front.duration_ns) == (10.0, 270.0, 20 * S)
    assert (weak.kind, weak.subject, front.subject) == ("motor-dead", "drone_1", "wind")


def test_a_requirement_may_bound_what_the_application_notes(workshop):
    workshop.change("requirements:\n", "requirements:\n  seen: {observe: note.point.inspected, min: 4}\n")
    bound = next(one for one in workshop.load().requirements if one.name == "seen")
    assert (bound.observe, bound.relation, bound.bound, bound.unit) == ("note.point.inspected", "min", 4, "")


def test_a_note_without_a_state_is_wrong(workshop):
    workshop.change("requirements:\n", "requirements:\n  seen: {observe: note.point, min: 4}\n")
    with pytest.raises(ModelError, match=r"seen.observe: 'note.point': write note.<kind>.<state>"):
        workshop.load()
