"""Grey cameras: pictures of the scene, with the calibration of their lens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from volery.base.errors import UsageError
from volery.base.frames import Vector, body_to_world, multiply, world_to_body
from volery.base.time import Ns
from volery.simulation.added_sensors.depth_camera import OPTICAL
from volery.simulation.world.rasteriser import CameraView, Exposure, Lens, Picture, Rasteriser
from volery.simulation.world.scene import Scene
from volery.simulation.world.sensors import Mounting, SampledSensor, SensorInput, SensorMessage


class Shot(NamedTuple):
    """An exposure. ``draw`` makes its picture, which takes longer than all else of a camera.

    Args:
        rasteriser: What draws it.
        view: Where the camera is and how it moves.
        ground: Height of the ground below, up [m].
        lux: Light [lx].
        number: Number of the grid step, of which its noise is.
    """

    rasteriser: Rasteriser
    view: CameraView
    ground: float
    lux: float
    number: int

    def draw(self) -> Picture:
        """Return a new picture (height, width)."""
        return self.rasteriser.draw(self.view, self.ground, self.lux, self.number)


class _CameraSampler:
    """Takes the pictures of one camera on one body."""

    def __init__(self, camera: Camera, noise: np.uint64, scene: Scene) -> None:
        self._mounting = camera.mounting or Mounting(turn=OPTICAL)
        self._rasteriser = Rasteriser(camera.lens, scene.solids, scene.markers, camera.exposure, noise)
        self._lux = scene.lux

    def __call__(self, state: SensorInput, k: int) -> Shot:
        """Return the exposure."""
        return Shot(self._rasteriser, view_of(state, self._mounting), state.ground, self._lux, k)


def view_of(state: SensorInput, mounting: Mounting) -> CameraView:
    """Return where a camera on a body is and how it moves."""
    at, turn = mounting
    off = body_to_world(state.attitude, at)
    east, north, up = (start + by for start, by in zip(state.position, off, strict=True))
    whole = multiply(state.attitude, turn)
    right, down, ahead = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    axes = np.array([body_to_world(whole, axis) for axis in (right, down, ahead)]).T
    (wx, wy, wz), (x, y, z) = state.rates, at
    swing: Vector = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    moved = body_to_world(state.attitude, swing)
    vx, vy, vz = (one + by for one, by in zip(state.velocity, moved, strict=True))
    return CameraView(
        (east, north, up), axes, world_to_body(whole, (vx, vy, vz)), world_to_body(turn, state.rates)
    )


@dataclass(frozen=True)
class Camera(SampledSensor):
    """A grey camera. It publishes ``sensor_msgs/Image`` (mono8) and ``sensor_msgs/CameraInfo``.

    Args:
        lens: Its lens.
        exposure: How it adapts to the light.
        late: Time from an exposure to its message [ns], less than its period.
    """

    lens: Lens
    exposure: Exposure
    late: Ns = 0

    type = "sensor_msgs/msg/Image"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.late < self.period:
            late, period = (f"{time / 1e6:g} ms" for time in (self.late, self.period))
            raise UsageError(f"{self.name}: a latency of {late}; give less than the period of {period}")

    @property
    def latency(self) -> Ns:
        """See ``SampledSensor``."""
        return self.late

    @property
    def frame(self) -> str:
        """Frame of its messages: right, down, ahead."""
        return f"{self.name}_optical_frame"

    def sampler(self, noise: np.uint64, scene: Scene) -> _CameraSampler:
        """See ``SampledSensor``."""
        return _CameraSampler(self, noise, scene)

    def publications(self) -> tuple[SensorMessage, ...]:
        """See ``SampledSensor``."""
        return (
            SensorMessage(f"{self.name}/image_raw", self.type, self.fill, on_demand=True),
            SensorMessage(f"{self.name}/camera_info", "sensor_msgs/msg/CameraInfo", self._fill_info),
        )

    def fill(self, message: Any, values: Any) -> None:
        """Write the picture of an exposure into an image."""
        picture: Picture = values.draw()
        message.height, message.width = picture.shape
        message.step, message.encoding = picture.shape[1], "mono8"
        message.data = picture.reshape(-1)

    def _fill_info(self, message: Any, _values: Any) -> None:
        lens, (column, row) = self.lens, self.lens.centre
        message.height, message.width, message.distortion_model = lens.height, lens.width, "plumb_bob"
        message.d = np.array(lens.distortion)
        message.k = np.array((lens.focal, 0.0, column, 0.0, lens.focal, row, 0.0, 0.0, 1.0))
        message.r = np.eye(3).reshape(-1)
        message.p = np.array((lens.focal, 0.0, column, 0.0, 0.0, lens.focal, row, 0.0, 0.0, 0.0, 1.0, 0.0))
