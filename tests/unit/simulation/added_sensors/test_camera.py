"""A camera on a body: where it looks, what it publishes, and that it blurs as its body moves."""

from math import pi

import numpy as np
import pytest

from rigs.walled_room import ROOM, state
from volery.autonomy.markers import MarkerFinder, camera_of, marker_cells, picture_of
from volery.autonomy.precision_landing import sight_of
from volery.base.errors import UsageError
from volery.base.frames import euler_to_quaternion, multiply
from volery.ros.messages import new
from volery.simulation.added_sensors.camera import Camera, view_of
from volery.simulation.added_sensors.depth_camera import OPTICAL
from volery.simulation.world.rasteriser import Exposure, Lens
from volery.simulation.world.scene import Marker, Scene
from volery.simulation.world.sensors import Mounting

DOWN = Mounting((0.2, 0.1, -0.05), multiply(euler_to_quaternion(0.0, pi / 2, 0.0), OPTICAL))
AHEAD = Mounting((0.0, 0.0, 0.0), OPTICAL)
LENS = Lens(distortion=(-0.2, 0.05, 0.001, -0.001, 0.0))
PAD = Marker("pad", marker_cells("36h11", 7), (1.0, 0.5, 0.0), 0.4)


def camera(mounting=DOWN, late=0):
    return Camera("camera", 10.0, LENS, Exposure(), late, mounting=mounting)


def messages(sensor, picture):
    made = [new(one.type) for one in sensor.publications()]
    for one, message in zip(sensor.publications(), made, strict=True):
        one.fill(message, picture)
    return made


def test_a_marker_is_seen_where_it_is_from_a_turned_and_tilted_body():
    scene = Scene(markers=[PAD])
    here = state((0.3, 0.2, 3.0), 0.08, -0.06, 2.0, scene=scene)
    image, info = messages(camera(), camera().sampler(np.uint64(1), scene)(here, 0))
    (found,) = MarkerFinder({7: 0.4}).find(picture_of(image), camera_of(info))
    sight = sight_of(found, 0, here.attitude, DOWN.turn, DOWN.at)
    assert sight.offset == pytest.approx((0.7, 0.3, -3.0), abs=0.05)


def test_it_looks_ahead_of_the_body_or_down():
    here = state((0.0, 0.0, 1.0), yaw=0.0)  # to the east
    assert view_of(here, AHEAD).axes[:, 2] == pytest.approx((1.0, 0.0, 0.0))
    assert view_of(here, AHEAD).axes[:, 0] == pytest.approx((0.0, -1.0, 0.0))
    assert view_of(here, DOWN).axes[:, 2] == pytest.approx((0.0, 0.0, -1.0))
    assert view_of(here, DOWN).axes[:, 1] == pytest.approx((-1.0, 0.0, 0.0)), "its upper edge is ahead"
    assert view_of(here, DOWN).at == pytest.approx((0.2, 0.1, 0.95))


def test_it_moves_with_the_body_and_swings_about_its_centre():
    here = state((0.0, 0.0, 1.0), velocity=(2.0, 0.0, 0.0))._replace(rates=(0.0, 0.0, 1.0))
    view = view_of(here, DOWN)
    assert view.velocity == pytest.approx((-0.2, -1.9, 0.0))  # right, down, ahead: of 1.9 east, 0.2 north
    assert view.rates == pytest.approx((0.0, 0.0, -1.0))


def test_walls_are_seen_and_the_picture_is_of_seed_and_time():
    here = state((0.0, 0.0, 1.0))
    first, same, other = (
        camera(AHEAD).sampler(np.uint64(seed), ROOM)(here, k).draw() for seed, k in ((1, 5), (1, 5), (1, 6))
    )
    assert (first == same).all()
    assert (first != other).any()
    assert first[119, 159] < 140, "a wall, and not the sky"


def test_messages_carry_picture_and_calibration():
    sensor = camera()
    shot = sensor.sampler(np.uint64(1), ROOM)(state((0.0, 0.0, 1.0)), 0)
    image, info = messages(sensor, shot)
    assert (image.encoding, image.height, image.width, image.step) == ("mono8", 240, 320, 320)
    assert (image.data == shot.draw().reshape(-1)).all()
    assert info.distortion_model == "plumb_bob"
    assert list(info.d) == list(LENS.distortion)
    assert [one.topic for one in sensor.publications()] == ["camera/image_raw", "camera/camera_info"]
    assert sensor.frame == "camera_optical_frame"


def test_a_latency_of_a_period_is_refused():
    with pytest.raises(UsageError, match=r"camera: a latency of 100 ms; give less than the period of 100 ms"):
        camera(late=100_000_000)
