"""Sensors of other packages: found by entry point, mounted, and without an effect on the flight."""

import math
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint, make_world
from volery.simulation.world import sensors
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.environment_models import Wind
from volery.simulation.world.sensors import ErrorModel, Gyroscope, Sensor, SensorSuite
from volery.simulation.world.world import World

EXAMPLE = Path(__file__).parents[4] / "examples" / "airspeed_sensor"
WIND = Wind(east=2.0, north=-3.0, gust=1.0)


@pytest.fixture
def airspeed_package(tmp_path, monkeypatch):
    """The example package as an installer leaves it: its module and its metadata on the path."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    points = project["entry-points"]
    info = tmp_path / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    groups = [
        f"[{group}]\n" + "".join(f"{name} = {target}\n" for name, target in entries.items())
        for group, entries in points.items()
    ]
    (info / "entry_points.txt").write_text("\n".join(groups))
    (tmp_path / "airspeed_sensor.py").write_text((EXAMPLE / "airspeed_sensor.py").read_text())
    monkeypatch.syspath_prepend(str(tmp_path))
    registry = vars(sensors.sensors)
    registry.pop("_installed", None)  # another test may have read what is installed
    yield
    registry.pop("_installed", None)
    sys.modules.pop("airspeed_sensor", None)


ERROR = ErrorModel(white_sigma=0.5, bias_sigma=2.0, correlation_time=5.0)


@dataclass(frozen=True)
class HeightSensor(Sensor):
    """True height and its negative, for tests of noise and sampling."""

    name: str = "height"
    error: ErrorModel = ERROR
    rate: float = 50.0

    def ideal(self, state):
        return state.position[2], -state.position[2]


@pytest.fixture
def registered(monkeypatch):
    """Register things for one test under the names given."""

    def register(**things):
        for name, thing in things.items():
            monkeypatch.setitem(sensors.sensors._added, name, thing)

    return register


def fly(clock, frame, added=(), seed=7, periods=(50,)):
    """Fly to a point with wind, and return (handle, columns of state at each read, measurements)."""
    clock.now = 0
    world, (flight,) = make_world(
        clock, [Multirotor(added_sensors=tuple(added))], seed=seed, frame=frame, wind=WIND
    )
    flight.set_origin()
    flight.drive(Setpoint(Control.IDLE))
    clock.now = 3 * S
    flight.estimate()
    flight.drive(Setpoint(Control.POSITION, position=(60.0, 0.0, -20.0), yaw=0.0))
    states, readings = [], []
    step = 0
    while clock.now < 12 * S:
        clock.now += periods[step % len(periods)] * MS
        step += 1
        flight.estimate()
        states.append((clock.now, world.arrays.rows.tobytes()))
        readings.append([flight.measurement(name) for name in added])
    return flight, states, readings


def test_an_installed_airspeed_sensor_measures_the_speed_through_the_air(clock, frame, airspeed_package):
    flight, _, readings = fly(clock, frame, ["airspeed"])
    truth, (reading,) = flight.truth(), readings[-1]
    row = flight._world.arrays.rows[0]
    state = flight._world._sensor_input(0, int(flight._world.arrays.reached[0]))
    relative = [v - air for v, air in zip(state.velocity, state.air_velocity, strict=True)]
    assert truth.velocity[1] > 1.0  # flies north, with its nose north, against the wind
    assert relative[1] > truth.velocity[1]
    assert reading.values[0] == pytest.approx(relative[1], abs=2.0)
    assert 0 <= truth.time - reading.time < 100 * MS
    assert np.isfinite(row).all()
    errors = [taken[0].values[0] for taken in readings[:20]]
    assert len(set(errors)) > 5


def test_a_mounted_sensor_changes_no_byte_of_the_flight(clock, frame, airspeed_package):
    _, without, _ = fly(clock, frame)
    _, with_sensor, _ = fly(clock, frame, ["airspeed"])
    assert with_sensor == without


def test_measurements_depend_on_seed_sensor_and_step_and_not_on_who_reads(clock, frame, registered):
    registered(height=HeightSensor(), other=HeightSensor(name="other"))
    _, _, often = fly(clock, frame, ["height", "other"], periods=(2, 8, 30))
    _, _, rarely = fly(clock, frame, ["height", "other"], periods=(200,))
    taken = {measurement.time: measurement for reading in often for measurement in reading[:1]}
    assert len([reading for reading in rarely if reading[0].time in taken]) > 5
    for reading in rarely:
        assert taken.get(reading[0].time, reading[0]) == reading[0]
        assert reading[0].time == reading[1].time
        assert reading[0].values != reading[1].values  # the same law under another name has other noise
    _, _, reseeded = fly(clock, frame, ["height"], seed=8, periods=(200,))
    assert reseeded[-1][0].values != rarely[-1][0].values


def test_the_errors_of_an_added_sensor_have_the_declared_deviations(clock, frame, registered):
    sensor = HeightSensor()
    registered(height=sensor)
    bodies = 20
    world = World(clock, [Multirotor(added_sensors=("height",))] * bodies, frame=frame)
    truth = world.truth(0).position[2]
    errors = []
    for _ in range(400):
        clock.now += 20 * MS
        errors.append([world.measurement(body, "height").values[0] - truth for body in range(bodies)])
    series = np.array(errors)
    steps = np.diff(series, axis=0)
    kept = math.exp(-0.02 / sensor.error.correlation_time)
    expected = math.sqrt(2.0 * sensor.error.white_sigma**2 + 2.0 * (1.0 - kept) * sensor.error.bias_sigma**2)
    assert steps.std() == pytest.approx(expected, rel=0.05)
    assert series.mean(axis=0).std() == pytest.approx(sensor.error.bias_sigma, rel=0.6)


def test_samples_lie_on_the_grid_of_the_sensors_rate(clock, frame, registered):
    registered(height=HeightSensor(rate=4.0))
    world = World(clock, [Multirotor(added_sensors=("height",))], frame=frame)
    assert world.measurement(0, "height").time == 0
    clock.now = 999 * MS
    assert world.measurement(0, "height").time == 750 * MS
    clock.now = 1000 * MS
    assert world.measurement(0, "height").time == 1000 * MS


def test_a_package_can_replace_the_parameters_of_the_built_in_sensors(clock, frame, registered):
    registered(noisy=SensorSuite("noisy", gyro=Gyroscope(white_sigma=0.5)))
    world = World(clock, [Multirotor(sensors="noisy"), Multirotor()], frame=frame)
    samples = []
    for _ in range(200):
        clock.now += 20 * MS
        samples.append(
            [world.advance_to_now(body) and world.arrays.rows[body, sensors.M_GYRO] for body in (0, 1)]
        )
    noisy, usual = np.array(samples).std(axis=0)
    assert noisy == pytest.approx(0.5, rel=0.2)
    assert usual < 0.01


def test_wrong_names_and_figures_are_refused(clock, frame, registered):
    registered(height=HeightSensor(), suite=SensorSuite("suite"))
    with pytest.raises(UsageError, match=r"no sensor named 'hieght'.*did you mean 'height'"):
        World(clock, [Multirotor(added_sensors=("hieght",))], frame=frame)
    with pytest.raises(UsageError, match="a suite of sensors"):
        World(clock, [Multirotor(added_sensors=("suite",))], frame=frame)
    with pytest.raises(UsageError, match="one sensor, not a suite"):
        World(clock, [Multirotor(sensors="height")], frame=frame)
    with pytest.raises(UsageError, match="body 0 has no sensor 'height'"):
        World(clock, [Multirotor()], frame=frame).measurement(0, "height")
    with pytest.raises(UsageError, match="Hz"):
        HeightSensor(rate=0.0)
    with pytest.raises(UsageError, match="standard deviations"):
        ErrorModel(white_sigma=-1.0)
