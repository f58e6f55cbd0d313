"""Floor plans: what the files of map_server say becomes walls; what is wrong names the model's line."""

import numpy as np
import pytest
from PIL import Image

from volery.base.errors import ModelError
from volery.model import floor_plan, map_file
from volery.model.floor_plan import cover

MAP = "image: hall.pgm\nresolution: 0.5\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
WORLD = "  world: city.yaml\n"


@pytest.fixture
def hall(workshop):
    """A picture of three by four cells: a wall in the north, and a pillar in the south-east."""
    picture = np.array([[0, 0, 0, 0], [254, 254, 205, 254], [254, 254, 254, 0]], dtype=np.uint8)
    Image.fromarray(picture).save(workshop.folder / "hall.pgm")
    (workshop.folder / "hall.yaml").write_text(MAP)
    return workshop.change(WORLD, f"{WORLD}  floor_plan: hall.yaml\n")


def boxes_of(workshop):
    """Bounds of each wall: west, south, east, north."""
    walls = np.array(workshop.load().environment.floor_plan.walls)
    return {(*wall.min(axis=0).tolist(), *wall.max(axis=0).tolist()) for wall in walls}


def test_occupied_cells_are_walls_and_unknown_ones_are_not(hall):
    assert boxes_of(hall) == {(-1.0, 3.0, 1.0, 3.5), (0.5, 2.0, 1.0, 2.5)}
    north, *_ = sorted(hall.load().environment.solids, key=lambda one: -one.corners[0][1])
    assert (north.floor_m, north.ceiling_m) == (0.0, 3.0)
    assert {one.name for one in hall.load().environment.solids} == {"hall_1", "hall_2"}


def test_height_negation_and_yaw(hall):
    hall.change("floor_plan: hall.yaml", "floor_plan: {file: hall.yaml, height: 2.4 m}")
    hall.change("negate: 0", "negate: 1", "hall.yaml")
    hall.change("0.0]", "1.5707963267948966]", "hall.yaml")
    plan = hall.load().environment.floor_plan
    assert plan.height_m == 2.4
    bounds = np.array(plan.walls).reshape(-1, 2)
    assert bounds.min(axis=0) == pytest.approx((-2.0, 2.0))  # a quarter turn about the corner (-1, 2)
    assert bounds.max(axis=0) == pytest.approx((-1.0, 4.0))


@pytest.mark.parametrize("kind", ["png", "transparent png", "sixteen bits", "plain pgm"])
def test_pictures_of_several_kinds_are_the_same_plan(hall, kind):
    before = boxes_of(hall)
    shades = np.asarray(Image.open(hall.folder / "hall.pgm"))
    file = hall.folder / ("hall.pgm" if "pgm" in kind else "hall.png")
    if kind == "png":
        Image.fromarray(shades).convert("RGB").save(file)
    elif kind == "transparent png":
        black = np.zeros((*shades.shape, 4), dtype=np.uint8)
        black[..., 3] = 255 - shades
        Image.fromarray(black, "RGBA").save(file)
    elif kind == "sixteen bits":
        Image.fromarray(shades.astype(np.uint16) * 257).save(file)
    else:
        file.write_text("P2\n4 3\n255\n" + " ".join(map(str, shades.reshape(-1))))
    hall.change("hall.pgm", file.name, "hall.yaml")
    assert boxes_of(hall) == before


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("hall.pgm", "hull.pgm", "hull.pgm: there is no such picture"),
        ("hall.pgm", "hall.yaml", "hall.yaml: this is no picture"),
        ("0.5", "0", "a resolution of 0.0 m a cell; give one from 0.001 to 10"),
        ("0.5", "fine", "a number is expected, not 'fine'"),
        ("resolution: 0.5\n", "", "resolution: this key is missing"),
        ("[-1.0, 2.0, 0.0]", "[-1.0, 2.0]", "three numbers: x, y and yaw"),
        ("occupied_thresh: 0.65", "occupied_thresh: 1.5", "no cell of hall.pgm is occupied"),
        ("image: hall.pgm", "image: ../hall.pgm", "outside"),
        (MAP, "[", "this is not YAML"),
    ],
)
def test_a_wrong_map_is_an_error_of_the_model(hall, old, new, said):
    hall.change(old, new, "hall.yaml")
    with pytest.raises(ModelError) as raised:
        hall.load()
    assert said in str(raised.value)
    assert "environment.floor_plan" in str(raised.value)


def test_a_missing_file_or_picture_for_it_is_an_error_of_the_model(hall):
    hall.change("floor_plan: hall.yaml", "floor_plan: hull.yaml")
    line = hall.line_of("floor_plan")
    with pytest.raises(
        ModelError, match=rf"model\.yaml:{line}: .*hull\.yaml: it cannot be read: No such file"
    ):
        hall.load()
    hall.change("floor_plan: hull.yaml", "floor_plan: hall.pgm")
    with pytest.raises(ModelError, match=r"hall\.pgm: this is not YAML; give the YAML file of the picture"):
        hall.load()


def test_huge_and_speckled_pictures_are_refused(hall, monkeypatch):
    monkeypatch.setattr(floor_plan, "MOST_WALLS", 1)
    with pytest.raises(ModelError, match=r"more than 1 rectangles cover .* hall\.pgm: remove its speckles"):
        hall.load()
    monkeypatch.setattr(map_file, "MOST_CELLS", 10)
    with pytest.raises(ModelError, match=r"hall\.pgm has 4 x 3 cells, 10 at most"):
        hall.load()


def test_rectangles_cover_the_occupied_cells_exactly_and_are_few():
    cells = np.zeros((600, 800), dtype=bool)
    cells[50:55, 50:750] = cells[545:550, 50:750] = cells[50:550, 50:55] = cells[50:550, 745:750] = True
    for wall in range(150, 750, 100):
        cells[50:250, wall : wall + 4] = cells[350:550, wall : wall + 4] = True
    rows, columns = np.mgrid[:600, :800]
    for pillar in range(100, 740, 64):
        cells |= (rows - 300) ** 2 + (columns - pillar) ** 2 < 64
    found = list(cover(cells))
    covered = np.zeros_like(cells)
    for left, bottom, right, top in found:
        covered[bottom:top, left:right] = True
    assert (covered == cells).all()
    assert len(found) < 300
