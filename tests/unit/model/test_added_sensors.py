"""Sensors that a model adds: alone, with settings, several of a kind; what is wrong names its line."""

from dataclasses import replace

import pytest

from volery.base.errors import ModelError
from volery.base.time import S
from volery.model.added_sensors import CameraSpec, LidarSpec, Odometry
from volery.model.faults import SensorClockOff

ROVER = "sensors: rtk, started: cold"


def sensors_of(workshop, written):
    workshop.change(ROVER, f"{ROVER}, added_sensors: {written}")
    _, rover = workshop.load().environment.vehicles
    return rover.added_sensors


@pytest.mark.parametrize("written", ["lidar", "[lidar]", "{lidar: {}}", "[{lidar: }]"])
def test_a_kind_alone_has_the_usual_settings(workshop, written):
    (lidar,) = sensors_of(workshop, written)
    assert lidar == LidarSpec()
    assert (lidar.named, lidar.topic("scan")) == ("lidar", "scan")


def test_settings_are_read_with_their_units(workshop):
    lidar, odometry = sensors_of(
        workshop,
        "[{lidar: {name: front, beams: 90, field: 1.5707963267948966 rad, range: 8 m, nearest: 5 cm, "
        "rate: 20 Hz, noise: 3 cm, lost: 1 %, at: [0.1, 0, 5 cm], heading: 90 deg}}, "
        "{odometry: {drift: 2 deg/min, scale: -3 %}}]",
    )
    assert (lidar.beams, lidar.range_m, lidar.nearest_m, lidar.rate_hz) == (90, 8.0, 0.05, 20.0)
    assert lidar.field_deg == pytest.approx(90.0)
    assert (lidar.noise_m, lidar.lost, lidar.at, lidar.heading_deg) == (0.03, 0.01, (0.1, 0.0, 0.05), 90.0)
    assert (lidar.named, lidar.topic("scan")) == ("front", "front/scan")
    assert odometry.drift_deg_s == pytest.approx(2.0 / 60.0)
    assert odometry.scale == -0.03
    assert Odometry().of_autopilot
    assert not odometry.of_autopilot


def test_a_camera_has_its_lens_and_its_place(workshop):
    (camera,) = sensors_of(
        workshop, "[{camera: {pitch: 90 deg, distortion: [-0.2, 0.05], latency: 20 ms, at: [0, 0, -5 cm]}}]"
    )
    made = CameraSpec(pitch_deg=90.0, distortion=(-0.2, 0.05, 0.0, 0.0, 0.0), at=(0.0, 0.0, -0.05))
    assert camera == replace(made, latency_ns=20_000_000)


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("lidr", "no sensor named 'lidr' (did you mean 'lidar'?)"),
        ("[{lidr: {beams: 3}}]", "did you mean 'lidar'?"),
        ("[{lidar: {baems: 3}}]", "unknown key (did you mean 'beams'?)"),
        ("[{lidar: {beams: 1}}]", "at least 2"),
        ("[{lidar: {range: 3 s}}]", "a length"),
        ("[{lidar: {at: [0, 1]}}]", "three lengths are expected (forward, left, up), not 2"),
        ("[{lidar: {name: a b}}]", "'a b' is no name"),
        ("[{lidar: {rate: 1000 Hz}}]", "at most 500"),
        ("[{lidar: {}, odometry: {}}]", "one name with its settings"),
        ("[{camera: {distortion: [1, 2, 3, 4, 5, 6]}}]", "at most five factors"),
        ("[{camera: {pitch: 100 deg}}]", "90"),
        ("[3]", "the name of a sensor"),
        ("[odometry, {odometry: {name: wheels, scale: 2 %}}]", "only one can move base_link"),
        ("[lidar, lidar]", "two sensors are called 'lidar'; give each a `name` of its own"),
    ],
)
def test_a_wrong_one_is_blamed_on_its_line(workshop, written, said):
    with pytest.raises(ModelError) as raised:
        sensors_of(workshop, written)
    text = str(raised.value)
    assert f"model.yaml:{workshop.line_of(ROVER)}" in text
    assert said in text


@pytest.mark.parametrize(
    ("kind", "sensor", "words"),
    [
        ("sensor-silent", "lidar", "no added sensor named 'lidar'.*front or odometry"),
        ("camera-black", "front", "no camera named 'front'"),
        ("ranges-maximum", "odometry", "no sensor of distances named 'odometry'.*there is front"),
    ],
)
def test_a_fault_of_a_sensor_that_cannot_have_it_is_refused(workshop, kind, sensor, words):
    workshop.change(ROVER, f"{ROVER}, added_sensors: [{{lidar: {{name: front}}}}, odometry]")
    fault = f"{{f: {{kind: {kind}, vehicle: rover_1, at: 5 s, sensor: {sensor}}}}}"
    workshop.change("  workload:", f"  faults: {fault}\n  workload:")
    with pytest.raises(ModelError, match=rf"environment\.faults\.f\.sensor: {words}"):
        workshop.load()


def test_a_fault_of_an_added_sensor_names_it(workshop):
    workshop.change(ROVER, f"{ROVER}, added_sensors: [lidar]")
    fault = "{f: {kind: sensor-clock-off, vehicle: rover_1, at: 5 s, sensor: lidar, by: -2 s}}"
    workshop.change("  workload:", f"  faults: {fault}\n  workload:")
    (fault,) = workshop.load().environment.faults
    assert fault == SensorClockOff(
        name="f", at_ns=5 * S, vehicle="rover_1", sensor="lidar", by_ns=-2 * S, where=fault.where
    )
