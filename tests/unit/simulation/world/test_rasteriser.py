"""Pictures show what rays meet, at the right place, in the light there is."""

from __future__ import annotations

import numpy as np
import pytest

from volery.base.errors import UsageError
from volery.simulation.world.rasteriser import CameraView, Exposure, Lens, Picture, Rasteriser
from volery.simulation.world.scene import DAY_LUX, DUSK_LUX, Marker, Scene, Solid

DOWN = np.array([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)])
"""Right is east, down in the picture is south, ahead is down."""
NORTHWARD = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)])
WHITE = np.ones((2, 2), dtype=np.uint8)


def box(east: float, north: float, side: float, floor: float, ceiling: float) -> Solid:
    corners = ((0.0, 0.0), (0.0, side), (side, side), (side, 0.0))
    return Solid("box", tuple((east + x, north + y) for x, y in corners), floor, ceiling)


BOXES = (box(-4.0, 12.0, 3.0, 0.0, 6.0), box(2.0, 20.0, 6.0, 0.0, 9.0), box(-1.0, 15.0, 4.0, 5.0, 7.0))


def white_pad(east: float, north: float, up: float = 0.0, size: float = 0.4, yaw: float = 0.0) -> Marker:
    return Marker("pad", WHITE, (east, north, up), size, yaw)


def centre_of(picture: Picture, threshold: int = 130) -> tuple[float, float]:
    """Column and row of the middle of what is bright."""
    weights = np.where(picture > threshold, picture.astype(float), 0.0)
    rows, columns = np.indices(picture.shape)
    return float((weights * columns).sum() / weights.sum()), float((weights * rows).sum() / weights.sum())


@pytest.mark.parametrize("distortion", [(0.0,) * 5, (-0.2, 0.05, 0.001, -0.001, 0.0)])
def test_a_pixel_shows_what_its_ray_meets(distortion: tuple[float, float, float, float, float]) -> None:
    lens = Lens(160, 120, 120.0, distortion)
    at = (0.5, 0.0, 3.0)
    picture = Rasteriser(lens, BOXES).draw(CameraView(at, NORTHWARD), 0.0)
    lines = np.concatenate((lens.sight_lines(), np.ones((120, 160, 1))), axis=2).reshape(-1, 3) @ NORTHWARD.T
    lines /= np.linalg.norm(lines, axis=1)[:, None]
    far = Scene(BOXES).cast(np.tile(at, (len(lines), 1)), lines, 100.0)
    solid, ground = np.isfinite(far), lines[:, 2] < 0.0
    sky = ~solid & ~ground
    bright = picture.reshape(-1) == picture.max()
    assert 0.2 < solid.mean() < 0.8
    assert (bright == sky).mean() > 0.99, "all but the pixels along edges"
    south = solid & (np.abs(far * lines[:, 1] - 12.0) < 1e-6)
    side = picture.reshape(-1)[south]
    assert 0.02 < side.std() / side.mean() < 0.15, "a side has a texture"


def test_the_texture_of_a_side_stays_on_it() -> None:
    lens, walls = Lens(160, 120, 120.0), (box(-4.0, 5.0, 8.0, 0.0, 6.0),)
    rasteriser = Rasteriser(lens, walls)
    one, other = (rasteriser.draw(CameraView((east, 0.0, 3.0), NORTHWARD), 0.0) for east in (0.0, 1.0))
    shift = round(120.0 * 1.0 / 5.0)
    same = np.corrcoef(one[:, shift:].ravel(), other[:, :-shift].ravel())[0, 1]
    unmoved = np.corrcoef(one[:, shift:].ravel(), other[:, shift:].ravel())[0, 1]
    assert same > 0.95
    assert abs(unmoved) < 0.5


def test_a_place_is_seen_where_a_pinhole_projects_it() -> None:
    lens = Lens(focal=240.0)
    picture = Rasteriser(lens, (), [white_pad(0.5, 0.25, yaw=0.4)]).draw(
        CameraView((0.0, 0.0, 3.0), DOWN), 0.0
    )
    column, row = centre_of(picture)
    assert column == pytest.approx(lens.centre[0] + 240.0 * 0.5 / 3.0, abs=0.05)
    assert row == pytest.approx(lens.centre[1] - 240.0 * 0.25 / 3.0, abs=0.05)


def test_the_size_of_a_marker_is_to_scale() -> None:
    picture = Rasteriser(Lens(focal=240.0), (), [white_pad(0.0, 0.0)]).draw(
        CameraView((0.0, 0.0, 3.0), DOWN), 0.0
    )
    with_margin = (240.0 * 0.4 * 1.5 / 3.0) ** 2
    assert (picture > 130).sum() == pytest.approx(with_margin, rel=0.05)


def test_the_yaw_of_a_marker_is_clockwise_from_north() -> None:
    cells = np.array([(0, 0), (1, 1)], dtype=np.uint8)  # the upper half is black
    marker = Marker("pad", cells, (0.0, 0.0, 0.0), 1.0, np.pi / 2)
    picture = Rasteriser(Lens(), (), [marker]).draw(CameraView((0.0, 0.0, 3.0), DOWN), 0.0)
    assert picture[120, 160 + 20] < 30, "black to the east"
    assert picture[120, 160 - 20] > 120, "white to the west"


def test_a_marker_on_a_roof_is_seen_there_and_one_below_it_is_not() -> None:
    roof = box(-2.0, -2.0, 4.0, 0.0, 5.0)
    on, below = white_pad(0.5, 0.0, up=5.0), white_pad(0.5, 0.0)
    picture = Rasteriser(Lens(), [roof], [on]).draw(CameraView((0.0, 0.0, 8.0), DOWN), 0.0)
    assert centre_of(picture)[0] == pytest.approx(159.5 + 240.0 * 0.5 / 3.0, abs=0.1)
    hidden = Rasteriser(Lens(), [roof], [below]).draw(CameraView((0.0, 0.0, 8.0), DOWN), 0.0)
    assert not (hidden > 130).any()


def test_a_solid_hides_part_of_a_marker() -> None:
    cover = box(0.0, -1.0, 2.0, 0.0, 0.05)
    pad = [white_pad(0.0, 0.0)]
    whole = Rasteriser(Lens(), (), pad).draw(CameraView((0.0, 0.0, 3.0), DOWN), 0.0)
    half = Rasteriser(Lens(), [cover], pad).draw(CameraView((0.0, 0.0, 3.0), DOWN), 0.0)
    assert (half > 130).sum() == pytest.approx(0.5 * (whole > 130).sum(), rel=0.1)


def test_dusk_is_made_up_by_exposure_and_noise() -> None:
    view = CameraView((0.0, 0.0, 3.0), DOWN)
    camera = Rasteriser(Lens(), (), [white_pad(0.0, 0.0)], noise=np.uint64(1))
    quiet = Rasteriser(Lens(), (), [white_pad(0.0, 0.0)]).draw(view, 0.0).astype(float)
    day, dusk = (camera.draw(view, 0.0, lux).astype(float) for lux in (DAY_LUX, DUSK_LUX))
    assert dusk.mean() == pytest.approx(day.mean(), rel=0.02)
    assert (dusk - quiet).std() > 2.0 * (day - quiet).std() > 0.0
    assert camera.draw(view, 0.0, 1.0).mean() < 0.2 * day.mean(), "beyond its gain"


def test_noise_is_a_function_of_key_and_counter() -> None:
    view = CameraView((0.0, 0.0, 3.0), DOWN)
    one, same, other = (Rasteriser(Lens(), noise=np.uint64(key)) for key in (1, 1, 2))
    first = one.draw(view, 0.0, k=0)
    one.draw(view, 0.0, k=1)
    assert (same.draw(view, 0.0, k=0) == first).all()
    assert (one.draw(view, 0.0, k=0) == first).all(), "whoever drew before"
    assert (one.draw(view, 0.0, k=1) != first).any()
    assert (other.draw(view, 0.0, k=0) != first).any()


def test_motion_blurs_by_as_much_as_the_picture_moves() -> None:
    camera = Rasteriser(Lens(), (), [white_pad(0.0, 0.0)], Exposure(0.02))
    still = camera.draw(CameraView((0.0, 0.0, 3.0), DOWN), 0.0, DUSK_LUX)
    moving = camera.draw(CameraView((0.0, 0.0, 3.0), DOWN, velocity=(5.0, 0.0, 0.0)), 0.0, DUSK_LUX)
    turning = camera.draw(CameraView((0.0, 0.0, 3.0), DOWN, rates=(0.0, -5.0 / 3.0, 0.0)), 0.0, DUSK_LUX)
    assert centre_of(moving) == pytest.approx(centre_of(still), abs=0.3)
    between = (moving[120] > 100) & (moving[120] < 180)  # of the ground's 70 and the pad's 190
    assert between.sum() == pytest.approx(2 * (80 / 120) * 240.0 * 5.0 * 0.02 / 3.0, abs=3), "both edges"
    assert np.abs(turning[100:140].astype(float) - moving[100:140]).mean() < 4.0, "much as by a turn"


def test_a_camera_among_walls_and_under_the_ground_still_sees() -> None:
    camera = Rasteriser(Lens(64, 48, 40.0), BOXES, [white_pad(0.0, 0.0)])
    for at in ((-4.0, 12.0, 6.0), (-2.5, 13.0, 3.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (-4.0, 11.99, 1.0)):
        assert camera.draw(CameraView(at, NORTHWARD), 0.0).shape == (48, 64)


def test_polygons_that_are_not_convex_have_their_roof() -> None:
    corners = ((-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (2.0, 3.0), (2.0, -2.0), (-3.0, -2.0))
    angle = Solid("angle", corners, 0.0, 2.0)
    scene = Scene([angle])
    lens = Lens(64, 48, 40.0)
    view = CameraView((0.0, 0.0, 8.0), DOWN)
    flat = Rasteriser(lens).draw(view, 0.0)
    picture = Rasteriser(lens, [angle]).draw(view, 0.0)
    lines = np.concatenate((lens.sight_lines(), np.ones((48, 64, 1))), axis=2).reshape(-1, 3) @ DOWN.T
    lines /= np.linalg.norm(lines, axis=1)[:, None]
    met = np.isfinite(scene.cast(np.tile(view.at, (len(lines), 1)), lines, 100.0))
    assert ((picture != flat).reshape(-1) == met).mean() > 0.97


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Lens(distortion=(-2.0, 0.0, 0.0, 0.0, 0.0)), "folds the picture"),
        (lambda: Lens(width=2), "at least 8 x 8"),
        (lambda: Exposure(0.0), "exposure above 0"),
        (lambda: Rasteriser(Lens(), (), [white_pad(0.0, 0.0, size=0.0)]), "marker pad: give square cells"),
    ],
)
def test_what_cannot_be_is_refused(make, says) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(UsageError, match=says):
        make()
