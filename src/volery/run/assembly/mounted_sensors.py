"""The added sensors of a vehicle as the simulation takes them: one function for each kind of the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import pi, radians
from typing import Any

from volery.base.elementary import tan
from volery.base.errors import ModelError, UsageError
from volery.base.frames import euler_to_quaternion, multiply
from volery.base.time import to_seconds
from volery.model import added_sensors as model
from volery.model.environment import VehicleSpec
from volery.simulation.added_sensors.beams import Ranging
from volery.simulation.added_sensors.camera import Camera
from volery.simulation.added_sensors.cone_ranger import INFRARED, ULTRASOUND, ConeRanger
from volery.simulation.added_sensors.dead_reckoning import DeadReckoning
from volery.simulation.added_sensors.depth_camera import OPTICAL, DepthCamera
from volery.simulation.added_sensors.external_imu import ExternalImu
from volery.simulation.added_sensors.lidar import Lidar, RingLidar
from volery.simulation.world.rasteriser import Exposure, Lens
from volery.simulation.world.sensors import Mounting, SampledSensor


def sensors_of(vehicle: VehicleSpec) -> Iterator[SampledSensor | str]:
    """Yield the sensors that are mounted on a vehicle, or their names where packages have registered them.

    Raises:
        ModelError: Settings contradict one another.
    """
    for sensor in vehicle.added_sensors:
        if isinstance(sensor, str):
            yield sensor
        elif not (isinstance(sensor, model.Odometry) and sensor.of_autopilot):
            try:
                yield _MAKERS[type(sensor)](sensor)
            except UsageError as error:
                at = f"environment.vehicles.{vehicle.name}.added_sensors.{sensor.named}"
                raise ModelError(str(error), at, vehicle.where) from None


def _mounting(one: model.SensorSpec) -> Mounting:
    forward, left, up = one.at
    turn = euler_to_quaternion(0.0, radians(one.pitch_deg), -radians(one.heading_deg))
    return Mounting((forward, left, up), turn)


def _ranging(one: model.RangingSensor) -> Ranging:
    return Ranging(one.nearest_m, one.range_m, one.noise_m, one.lost)


def _lidar(one: model.LidarSpec) -> Lidar:
    field = 2.0 * pi if one.field_deg == 360.0 else radians(one.field_deg)
    return Lidar(
        one.named, one.rate_hz, _ranging(one), one.beams, field,
        topic=one.topic("scan"), mounting=_mounting(one),
    )  # fmt: skip


def _ring_lidar(one: model.RingLidarSpec) -> RingLidar:
    angles = radians(one.lowest_deg), radians(one.highest_deg)
    return RingLidar(
        one.named, one.rate_hz, _ranging(one), one.rings, one.columns, *angles,
        topic=one.topic("points"), mounting=_mounting(one),
    )  # fmt: skip


def _depth_camera(one: model.DepthCameraSpec) -> DepthCamera:
    at, turn = _mounting(one)
    return DepthCamera(
        one.named, one.rate_hz, _ranging(one), one.width, one.height, radians(one.field_deg),
        topic=one.name, mounting=Mounting(at, multiply(turn, OPTICAL)),
    )  # fmt: skip


def _cone(one: model.RangeFinderSpec | model.Sonar) -> ConeRanger:
    radiation, usual = (ULTRASOUND, "sonar") if isinstance(one, model.Sonar) else (INFRARED, "range")
    return ConeRanger(
        one.named, one.rate_hz, _ranging(one), radians(one.field_deg), radiation,
        topic=one.topic(usual), mounting=_mounting(one),
    )  # fmt: skip


def _external_imu(one: model.ExternalImuSpec) -> ExternalImu:
    return ExternalImu(one.named, one.rate_hz, topic=one.topic("imu_external"), mounting=Mounting())


def _camera(one: model.CameraSpec) -> Camera:
    at, turn = _mounting(one)
    focal = 0.5 * one.width / tan(0.5 * radians(one.field_deg))
    k1, k2, p1, p2, k3 = one.distortion
    return Camera(
        one.named,
        one.rate_hz,
        Lens(one.width, one.height, focal, (k1, k2, p1, p2, k3)),
        Exposure(to_seconds(one.exposure_ns)),
        one.latency_ns,
        mounting=Mounting(at, multiply(turn, OPTICAL)),
    )


def _odometry(one: model.Odometry) -> DeadReckoning:
    return DeadReckoning(one.named, one.rate_hz, one.drift_deg_s or 0.0, one.scale or 0.0)


_MAKERS: dict[type[model.AddedSensor], Callable[[Any], SampledSensor]] = {
    model.CameraSpec: _camera,
    model.LidarSpec: _lidar,
    model.RingLidarSpec: _ring_lidar,
    model.DepthCameraSpec: _depth_camera,
    model.RangeFinderSpec: _cone,
    model.Sonar: _cone,
    model.ExternalImuSpec: _external_imu,
    model.Odometry: _odometry,
}
