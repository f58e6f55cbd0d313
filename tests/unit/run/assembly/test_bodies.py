"""Bodies of a model's airframes: against published figures, in flight, and in the autopilots' parameters."""

from dataclasses import replace
from math import hypot, radians
from pathlib import Path

import pytest

from volery.analysis.budgets import hover_time, hovers
from volery.base.errors import ModelError
from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.model.airframes import FRAMES as FRAMES_OF_MODELS
from volery.model.airframes import BatterySpec
from volery.model.environment import PlaceSpec, VehicleSpec, WindSpec
from volery.model.system_loader import load
from volery.run.assembly.bodies import body_of
from volery.run.assembly.model_checks import vocabulary
from volery.run.assembly.simulated_fleet import FleetWorld, SimulatedFleet
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint, make_world
from volery.simulation.world.body_specs import FRAMES, Multirotor, WheeledRover

PAD = PlaceSpec("pad", 47.4, 8.5, 400.0, 12.0, -3.0, "pad")
EXAMPLES = Path(__file__).parents[4] / "examples" / "airframes"
MODEL = """\
volery: 1
name: frames
environment:
  vehicles:
    quad: {kind: multirotor, autopilot: ardupilot, airframe: quad.yaml, at: {east: 0 m}}
    hexa: {kind: multirotor, autopilot: px4, airframe: hexa.yaml, at: {east: 10 m}}
"""
ENERGY_LEFT = 0.1
"""Share of the charge with which the maker lands."""

PUBLISHED_MINUTES = {  # airframe, payload kg, battery A h, more mass of it kg: minutes
    ("quad", 0.0, 4.5, 0.0): 22.0,
    ("quad", 0.5, 4.5, 0.0): 17.0,
    ("quad", 1.0, 4.5, 0.0): 13.0,
    ("quad", 0.0, 5.7, 0.076): 28.0,
    ("quad", 0.5, 5.7, 0.076): 20.0,
    ("quad", 1.0, 5.7, 0.076): 16.0,
    ("hexa", 0.0, 27.0, 0.0): 35.0,
    ("hexa", 6.0, 27.0, 0.0): 16.0,
    ("hexa", 0.0, 34.2, 0.51): 40.0,
}
"""DJI, Hardware Introduction of the Onboard SDK (2017), table of payload and flight time: Matrice 100 with
TB47D and TB48D, Matrice 600 with six TB47S and TB48S. Left out: the Matrice 600 with TB48S and 5.5 kg; the
maker states 18 min, the law gives 22; for as much mass with three quarters of the energy it states 16."""

PUBLISHED_SPEEDS = {"quad": (35.0, 18.0), "hexa": (25.0, 18.0)}
"""Largest tilt in degrees and largest speed in m/s, from the same source and the data sheets."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("airframes")
    for file in EXAMPLES.glob("*.yaml"):
        (made / file.name).write_text(file.read_text())
    (made / "model.yaml").write_text(MODEL)
    return made


def system_of(folder, *overrides):
    return load(folder / "model.yaml", vocabulary(), overrides=overrides)


def vehicle_of(folder, name, *overrides):
    return system_of(folder, *(f"environment.vehicles.{name}.{one}" for one in overrides)).vehicle(name)


@pytest.mark.parametrize(("case", "minutes"), PUBLISHED_MINUTES.items())
def test_hover_times_are_those_that_the_maker_states(folder, case, minutes):
    name, payload, ampere_hours, more = case
    vehicle = vehicle_of(folder, name, f"payload={payload} kg", f"battery={ampere_hours} Ah")
    airframe = vehicle.airframe
    battery = replace(airframe.battery, capacity_coulomb=ampere_hours * 3600.0)
    body = body_of(
        replace(
            vehicle,
            airframe=replace(airframe, mass_kg=airframe.mass_kg + more, battery=battery),
            battery=None,
        )
    )
    assert hover_time(body, body.hover_power, ENERGY_LEFT) / 60.0 == pytest.approx(minutes, rel=0.11)


@pytest.mark.parametrize("name", PUBLISHED_SPEEDS)
def test_top_speeds_are_those_that_the_maker_states(folder, name):
    tilt, speed = PUBLISHED_SPEEDS[name]
    assert body_of(vehicle_of(folder, name)).top_level_speed(radians(tilt)) == pytest.approx(speed, rel=0.1)


def test_a_body_flies_by_its_laws(folder):
    """Hover power with a payload, and the speed at a tilt, of the compiled step against the laws."""
    kernel = VirtualKernel()
    loaded = body_of(
        vehicle_of(folder, "hexa", "payload=3 kg", "airframe.frame=octo-plus", "airframe.arm=0.8 m")
    )
    plain = body_of(vehicle_of(folder, "quad"))
    _, flights = make_world(kernel.now, [loaded, plain], seed=1, frame=LocalFrame(47.0, 8.0))
    for flight in flights:
        flight.set_origin()
        flight.drive(Setpoint(Control.POSITION, position=(0.0, 0.0, -20.0)))
    kernel.every(S // 2, lambda: [flight.truth() for flight in flights])  # who is not read does not move
    kernel.run(30 * S)
    before = [flight.truth() for flight in flights]
    kernel.run(40 * S)
    for flight, start in zip(flights, before, strict=True):
        truth = flight.truth()
        assert truth.position[2] == pytest.approx(20.0, abs=1.0)
        assert (truth.energy_j - start.energy_j) / 10.0 == pytest.approx(flight.spec.hover_power, rel=0.04)
        assert flight.estimate().hover_throttle == pytest.approx(flight.estimate().throttle, rel=0.1)
    far = Setpoint(Control.POSITION, position=(3000.0, 0.0, -20.0), speed=60.0, accel=5.0, tilt=radians(30.0))
    flights[1].drive(far)
    kernel.run(75 * S)
    flown = hypot(*flights[1].truth().velocity[:2])
    assert flown == pytest.approx(plain.top_level_speed(radians(30.0)), rel=0.06)


def test_more_payload_takes_more_energy_by_momentum_theory(folder):
    powers = []
    for payload in (0.0, 1.0):
        body = body_of(vehicle_of(folder, "quad", f"payload={payload} kg"))
        powers.append(body.hover_power - body.idle_power)
    assert powers[1] / powers[0] == pytest.approx((3.355 / 2.355) ** 1.5, rel=1e-9)


@pytest.mark.parametrize(
    ("frame", "kind", "stated"),
    [
        ("quad-plus", 2, {"ardupilot": (1, 0), "px4": (4, 5001)}),
        ("hexa-x", 13, {"ardupilot": (2, 1), "px4": (6, 6001)}),
        ("octo-x", 14, {"ardupilot": (3, 1), "px4": (8, 8001)}),
    ],
)
def test_an_autopilot_is_configured_for_the_airframe(folder, frame, kind, stated):
    changes = f"airframe.frame={frame}", "airframe.arm=0.8 m"
    vehicles = [
        replace(vehicle_of(folder, "hexa", *changes, f"autopilot={autopilot}", "airframe.motors.thrust=70 N"),
                name=autopilot)
        for autopilot in stated
    ]  # fmt: skip
    kernel = VirtualKernel()
    fleet = SimulatedFleet(kernel, vehicles, FleetWorld(LocalFrame(47.0, 8.0), WindSpec()), 1)
    names = {"ardupilot": ("FRAME_CLASS", "FRAME_TYPE"), "px4": ("CA_ROTOR_COUNT", "SYS_AUTOSTART")}
    for vehicle in vehicles:
        autopilot = fleet.autopilots[vehicle.name]
        parameters = autopilot.vehicle.parameters
        assert tuple(parameters[one] for one in names[vehicle.name]) == stated[vehicle.name]
        heard = []
        fleet.link(vehicle.name).receive(heard.append)
        kernel.run(kernel.now() + 3 * S)
        assert {one.fields["type"] for one in heard if one.name == "HEARTBEAT"} == {kind}
    hover = body_of(vehicles[0]).hover_throttle
    assert fleet.autopilots["px4"].vehicle.parameters["MPC_THR_HOVER"] == pytest.approx(hover, abs=1e-3)
    assert fleet.autopilots["ardupilot"].vehicle.parameters["MOT_THST_HOVER"] < hover


def test_frames_of_models_are_those_of_the_simulation():
    assert {name: len(rotors) for name, rotors in FRAMES.items()} == FRAMES_OF_MODELS
    for rotors in FRAMES.values():
        assert sum(spin for _, spin in rotors) == 0


def test_model_and_simulation_agree_on_what_is_lifted(folder):
    vehicle = vehicle_of(folder, "quad")
    assert body_of(vehicle).spare_lift == pytest.approx(vehicle.airframe.spare_kg, rel=1e-6)
    usual = Multirotor()
    with pytest.raises(ModelError, match=r"payload: a payload of 9 kg is too heavy: .* can lift 5\.5 kg"):
        body_of(replace(vehicle, airframe=None, payload_kg=9.0))
    assert usual.spare_lift == pytest.approx(5.5, abs=0.05)


def test_coefficients_of_a_static_test_give_the_figure_of_merit(folder):
    stated = "airframe.propellers={diameter: 0.33 m, thrust_coefficient: 0.1, power_coefficient: 0.04}"
    assert body_of(vehicle_of(folder, "quad", stated)).figure_of_merit == pytest.approx(0.6308, abs=1e-4)


WRONG = {
    "airframe.mass=9 kg": r"airframe\.mass: 9 kg cannot hover: 4 motors of 17 N lift 6\.26 kg",
    "airframe.propellers.diameter=0 m": "0 m is too little",
    "airframe.propellers.diameter=0.6 m": "propellers of 0.6 m hit one another: .* 0.46 m between",
    "airframe.propellers.thrust_coefficient=0.1": r"quad\.yaml:5: .* state both",
    "airframe=no.yaml": "there is no file 'no.yaml'",
    "airframe=../model.yaml": "outside the folder",
    "airframe=wrong.yaml": r"wrong\.yaml:2: .*\.sails: unknown key",
    "payload=4 kg": "4 kg are too heavy: beside its own 2.355 kg it lifts 3.9 kg",
    "autopilot=dji": r"model\.yaml:5: .* a simulated dji flies its own airframe; ardupilot or px4 fly others",
    "kind=rover": r"model\.yaml:5: .* a rover has no airframe",
}


@pytest.mark.parametrize(("change", "message"), WRONG.items())
def test_an_airframe_that_cannot_fly_is_refused_where_it_is_stated(folder, change, message):
    (folder / "wrong.yaml").write_text("frame: quad-x\nsails: 1\n")
    with pytest.raises(ModelError, match=message):
        vehicle_of(folder, "quad", change)


def test_what_a_model_states_beside_the_file_wins(folder):
    stated = "airframe={file: quad.yaml, mass: 3 kg, motors: {efficiency: 0.7}}"
    airframe = vehicle_of(folder, "quad", stated).airframe
    assert (airframe.mass_kg, airframe.motors.efficiency, airframe.motors.thrust_n) == (3.0, 0.7, 17.0)
    (one, _) = hovers(system_of(folder, f"environment.vehicles.quad.{stated}"))
    assert (one.vehicle, one.frame, one.mass_kg) == ("quad", "quad-x", 3.0)


@pytest.mark.parametrize(("kind", "body"), [("multirotor", Multirotor), ("rover", WheeledRover)])
def test_a_body_stands_at_its_place_with_its_sensors(kind, body):
    vehicle = VehicleSpec("v", kind, "ardupilot", PAD, 90.0, None, "rtk", ("airspeed",))
    spec = body_of(vehicle)
    assert isinstance(spec, body)
    assert spec.at[:2] == (12.0, -3.0)
    assert spec.heading_deg == 90.0
    assert (spec.sensors, spec.added_sensors) == ("rtk", ("airspeed",))
    assert spec.battery == body().battery


def test_a_battery_in_the_model_replaces_the_usual_one():
    vehicle = VehicleSpec("v", "multirotor", "ardupilot", PAD, battery=BatterySpec(capacity_coulomb=3600.0))
    spec = body_of(vehicle)
    assert spec.battery.capacity_ah == pytest.approx(1.0)
    assert spec.added_sensors == ()
