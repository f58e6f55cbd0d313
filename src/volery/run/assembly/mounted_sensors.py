"""The added sensors of a vehicle as the simulation takes them: one function for each kind of the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import pi, radians
from typing import Any

from volery.base.errors import ModelError, UsageError
from volery.base.frames import euler_to_quaternion
from volery.model import added_sensors as model
from volery.model.environment import Vehicle
from volery.simulation.added_sensors.beams import Ranging
from volery.simulation.added_sensors.dead_reckoning import DeadReckoning
from volery.simulation.added_sensors.lidar import Lidar
from volery.simulation.world.sensors import Mounting, SampledSensor


def sensors_of(vehicle: Vehicle) -> Iterator[SampledSensor | str]:
    """Yield the sensors that are mounted on a vehicle, or their names where packages have registered them.

    Raises:
        ModelError: Settings contradict one another.
    """
    for one in vehicle.added_sensors:
        if isinstance(one, str):
            yield one
        elif not (isinstance(one, model.Odometry) and one.of_autopilot):
            try:
                yield _MAKERS[type(one)](one)
            except UsageError as error:
                at = f"environment.vehicles.{vehicle.name}.added_sensors.{one.named}"
                raise ModelError(str(error), at, vehicle.where) from None


def _mounting(one: model.MountedSensor) -> Mounting:
    forward, left, up = one.at
    return Mounting((forward, left, up), euler_to_quaternion(0.0, 0.0, -radians(one.heading_deg)))


def _lidar(one: model.Lidar) -> Lidar:
    return Lidar(
        one.named,
        one.rate_hz,
        Ranging(one.nearest_m, one.range_m, one.noise_m, one.lost),
        one.beams,
        2.0 * pi if one.field_deg == 360.0 else radians(one.field_deg),
        topic=one.topic("scan"),
        mounting=_mounting(one),
    )


def _odometry(one: model.Odometry) -> DeadReckoning:
    return DeadReckoning(one.named, one.rate_hz, one.drift_deg_s or 0.0, one.scale or 0.0)


_MAKERS: dict[type[model.AddedSensor], Callable[[Any], SampledSensor]] = {
    model.Lidar: _lidar,
    model.Odometry: _odometry,
}
