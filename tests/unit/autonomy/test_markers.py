"""Markers are found where they are, as surely as is said."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from volery.autonomy.markers import (
    CameraModel,
    MarkerFinder,
    camera_of,
    marker_cells,
    picture_of,
    rectified_camera_of,
)
from volery.base.errors import UsageError
from volery.ros.messages import new
from volery.simulation.world.rasteriser import CameraView, Lens, Rasteriser
from volery.simulation.world.scene import DAY_LUX, DUSK_LUX, Marker

DOWN = np.diag((1.0, -1.0, -1.0))
LENS = Lens(distortion=(-0.2, 0.05, 0.001, -0.001, 0.0))
CAMERA = CameraModel(
    np.array([(LENS.focal, 0.0, LENS.centre[0]), (0.0, LENS.focal, LENS.centre[1]), (0.0, 0.0, 1.0)]),
    np.array(LENS.distortion),
)


def draw(family="36h11", *, at=(0.2, -0.3, 3.0), axes=DOWN, yaw=0.5, lux=DAY_LUX, seed=1):  # type: ignore[no-untyped-def]
    marker = Marker("pad", marker_cells(family, 7), (0.0, 0.0, 0.0), 0.4, yaw)
    return Rasteriser(LENS, (), [marker], noise=np.uint64(seed)).draw(CameraView(at, axes), 0.0, lux)


@pytest.mark.parametrize("family", ["36h11", "16h5", "aruco_4x4", "aruco_5x5", "aruco_6x6"])
def test_each_family_is_found_at_its_place(family: str) -> None:
    (found,) = MarkerFinder({7: 0.4}, family).find(draw(family), CAMERA)
    assert found.id == 7
    assert found.at == pytest.approx((-0.2, -0.3, 3.0), abs=0.05)
    right = found.turn[:, 0]  # of a marker whose upper edge points 0.5 rad east of north
    assert right == pytest.approx((np.cos(0.5), np.sin(0.5), 0.0), abs=0.25)
    assert found.turn @ found.turn.T == pytest.approx(np.eye(3), abs=1e-9)


def test_places_are_within_their_covariance_by_day_and_at_dusk() -> None:
    random = np.random.default_rng(5)
    finder = MarkerFinder({7: 0.4})
    normalised, missed = [], 0
    for trial in range(60):
        height = random.uniform(0.9, 6.0)
        at = np.array([random.uniform(-0.25, 0.25) * height, random.uniform(-0.15, 0.15) * height, height])
        axes = DOWN @ cv2.Rodrigues(np.array([*random.uniform(-0.15, 0.15, 2), 0.0]))[0]
        lux = DAY_LUX if trial % 2 else DUSK_LUX
        picture = draw(at=tuple(at), axes=axes, yaw=random.uniform(-3, 3), lux=lux, seed=trial)
        found = finder.find(picture, CAMERA)
        if not found:
            missed += 1
            continue
        error = found[0].at + axes.T @ at
        normalised.append(error @ np.linalg.solve(found[0].covariance[:3, :3], error))
    assert missed <= 2
    assert 1.0 < np.mean(normalised) < 6.0, "3 if the covariance is right"


def test_other_numbers_and_families_are_not_taken_for_it() -> None:
    assert MarkerFinder({8: 0.4}).find(draw(), CAMERA) == []
    assert MarkerFinder({7: 0.4}, "aruco_4x4").find(draw(), CAMERA) == []


def test_no_marker_is_seen_in_noise_or_in_a_white_picture() -> None:
    finder = MarkerFinder(dict.fromkeys(range(50), 0.4))
    noise = np.random.default_rng(1).integers(0, 256, (240, 320)).astype(np.uint8)
    for picture in (noise, np.full((240, 320), 255, dtype=np.uint8), np.zeros((240, 320), dtype=np.uint8)):
        assert finder.find(picture, CAMERA) == []


@pytest.mark.parametrize("ros1", [True, False])
def test_messages_give_picture_and_camera(ros1: bool) -> None:
    names = ("K", "D") if ros1 else ("k", "d")
    info = SimpleNamespace(
        distortion_model="plumb_bob", **{names[0]: CAMERA.matrix.reshape(-1), names[1]: list(LENS.distortion)}
    )
    camera = camera_of(info)
    assert (camera.matrix == CAMERA.matrix).all()
    assert (camera.distortion == CAMERA.distortion).all()
    image = new("sensor_msgs/msg/Image")
    image.height, image.width, image.step, image.encoding = 2, 3, 4, "mono8"
    image.data = np.arange(8, dtype=np.uint8)
    assert picture_of(image).tolist() == [[0, 1, 2], [4, 5, 6]]
    assert camera_of(new_camera_info()).matrix[0, 0] == 240.0


def test_rectified_pictures_have_a_model_of_their_own() -> None:
    info = new_camera_info()
    info.d = [0.1] * 5
    info.p = [200.0, 0.0, 160.0, -12.0, 0.0, 210.0, 120.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    camera = rectified_camera_of(info)
    assert camera.matrix.tolist() == [[200.0, 0.0, 160.0], [0.0, 210.0, 120.0], [0.0, 0.0, 1.0]]
    assert not camera.distortion.any()
    with pytest.raises(UsageError, match="no focal length in P"):
        rectified_camera_of(new("sensor_msgs/msg/CameraInfo"))


@pytest.mark.parametrize(("encoding", "red"), [("rgb8", 0), ("bgr8", 2), ("rgba8", 0), ("bgra8", 2)])
def test_colours_become_grey(encoding: str, red: int) -> None:
    channels = 4 if "a" in encoding else 3
    image = new("sensor_msgs/msg/Image", height=1, width=2, step=2 * channels + 1, encoding=encoding)
    pixels = np.zeros(2 * channels + 1, dtype=np.uint8)
    pixels[red] = 200
    image.data = pixels
    assert picture_of(image).tolist() == [[60, 0]], "red is 0.299 of the grey"


def new_camera_info():  # type: ignore[no-untyped-def]
    info = new("sensor_msgs/msg/CameraInfo")
    info.k = CAMERA.matrix.reshape(-1)
    return info


def test_bad_input_is_named() -> None:
    image = new("sensor_msgs/msg/Image")
    image.encoding, image.height, image.width, image.step = "bayer_rggb8", 2, 2, 2
    with pytest.raises(UsageError, match=r"bayer_rggb8.*mono8"):
        picture_of(image)
    image.encoding = "mono8"
    with pytest.raises(UsageError, match="has 0 bytes"):
        picture_of(image)
    with pytest.raises(UsageError, match="not calibrated"):
        camera_of(new("sensor_msgs/msg/CameraInfo"))
    with pytest.raises(UsageError, match=r"no family of markers '36h12'.*36h11"):
        MarkerFinder({7: 0.4}, "36h12")
    with pytest.raises(UsageError, match="marker 7: give its side"):
        MarkerFinder({7: 0.0})
    with pytest.raises(UsageError, match="from 0 to 586"):
        marker_cells("36h11", 587)
