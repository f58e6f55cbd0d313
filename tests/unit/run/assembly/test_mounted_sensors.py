"""What the settings of a model make of the sensors of the simulation, and how frames are called."""

from dataclasses import replace
from math import pi, radians

import numpy as np
import pytest

from volery.base.errors import ModelError
from volery.base.frames import body_to_world
from volery.model.added_sensors import (
    CameraSpec,
    DepthCameraSpec,
    ExternalImuSpec,
    LidarSpec,
    Odometry,
    RangeFinderSpec,
    RingLidarSpec,
    Sonar,
)
from volery.model.environment import PlaceSpec, VehicleSpec
from volery.run.assembly.mounted_sensors import sensors_of
from volery.run.assembly.sensor_node import frames_of
from volery.simulation.added_sensors.beams import Ranging

PAD = PlaceSpec("pad", 47.0, 8.0, 400.0, 0.0, 0.0)
VEHICLE = VehicleSpec("v", "rover", "ardupilot", PAD)


def made(*added):
    return list(sensors_of(replace(VEHICLE, added_sensors=added)))


def test_a_lidar_is_mounted_where_the_model_says():
    settings = LidarSpec(
        name="front", beams=91, field_deg=90.0, noise_m=0.02, at=(0.1, 0.2, 0.3), heading_deg=90.0
    )
    (lidar,) = made(settings)
    assert (lidar.name, lidar.topic, lidar.frame) == ("front", "front/scan", "front")
    assert lidar.ranging == Ranging(0.1, 12.0, 0.02)
    assert lidar.mounting.at == (0.1, 0.2, 0.3)
    ahead = body_to_world(lidar.mounting.turn, (1.0, 0.0, 0.0))
    assert ahead == pytest.approx((0.0, -1.0, 0.0))  # to the right
    assert (lidar.first, lidar.between) == pytest.approx((-pi / 4, radians(1.0)))
    assert np.allclose(np.linalg.norm(lidar.beams(), axis=1), 1.0)


@pytest.mark.parametrize(
    ("settings", "topics", "ahead"),
    [
        (RingLidarSpec(), ["points"], (1.0, 0.0, 0.0)),
        (RangeFinderSpec(), ["range"], (0.0, 0.0, -1.0)),
        (RangeFinderSpec(name="low", pitch_deg=0.0, heading_deg=180.0), ["low/range"], (-1.0, 0.0, 0.0)),
        (Sonar(name="left", heading_deg=270.0), ["left/sonar"], (0.0, 1.0, 0.0)),
        (ExternalImuSpec(), ["imu_external"], (1.0, 0.0, 0.0)),
    ],
)
def test_where_sensors_look_and_publish(settings, topics, ahead):
    (sensor,) = made(settings)
    assert [one.topic for one in sensor.publications()] == topics
    assert (sensor.name, sensor.rate) == (settings.named, settings.rate_hz)
    assert body_to_world(sensor.mounting.turn, (1.0, 0.0, 0.0)) == pytest.approx(ahead)


def test_a_depth_camera_is_turned_from_its_optical_frame():
    (camera,) = made(DepthCameraSpec(name="below", pitch_deg=90.0, at=(0.0, 0.0, -0.1)))
    assert [one.topic for one in camera.publications()] == [
        "below/depth/image_rect",
        "below/depth/camera_info",
    ]
    assert camera.frame == "below_optical_frame"
    assert body_to_world(camera.mounting.turn, (0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0, -1.0))
    assert body_to_world(camera.mounting.turn, (0.0, -1.0, 0.0)) == pytest.approx((1.0, 0.0, 0.0))


def test_a_camera_looks_where_the_model_says():
    (camera,) = made(CameraSpec(pitch_deg=90.0, heading_deg=90.0, field_deg=90.0, at=(0.1, 0.0, -0.1)))
    assert camera.lens.focal == pytest.approx(160.0)
    assert camera.mounting.at == (0.1, 0.0, -0.1)
    assert body_to_world(camera.mounting.turn, (0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0, -1.0))
    upper_edge = body_to_world(camera.mounting.turn, (0.0, -1.0, 0.0))
    assert upper_edge == pytest.approx((0.0, -1.0, 0.0))  # to the right
    with pytest.raises(ModelError, match=r"added_sensors\.camera.*less than the period of 20 ms"):
        made(CameraSpec(rate_hz=50.0))


def test_the_estimate_of_the_autopilot_is_no_sensor_of_the_world():
    assert made(Odometry(), "airspeed") == ["airspeed"]
    (reckoning,) = made(Odometry(scale=0.03))
    assert (reckoning.name, reckoning.drift_deg_s, reckoning.scale) == ("odometry", 0.0, 0.03)


def test_settings_that_contradict_one_another_are_errors_of_the_model():
    with pytest.raises(ModelError, match=r"vehicles\.v\.added_sensors\.lidar.*give the shorter one first"):
        made(LidarSpec(nearest_m=20.0))


def test_frames_bear_the_name_of_the_vehicle_where_several_have_such():
    one = replace(VEHICLE, added_sensors=(LidarSpec(),))
    plain = replace(VEHICLE, name="w", added_sensors=("airspeed",))
    assert frames_of([one, plain]) == {"v": ""}
    assert frames_of([one, replace(one, name="w")]) == {"v": "v/", "w": "w/"}
