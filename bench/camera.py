"""Time of a grey picture of 320 x 240 pixels of a city of 2,400 triangles, beside MuJoCo's rays through it.

The same boxes are met by one ray a pixel (``mj_multiRay``), which is the distance picture of a widely used
simulator without a graphics card. The goal is less than 2 ms plain, less than 8 ms with lens, motion blur,
exposure and noise. Finding a marker in the picture is timed as well.

    python bench/camera.py [--rounds 30]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from random import Random
from time import process_time

import mujoco
import numpy as np

from volery.autonomy.markers import CameraModel, MarkerFinder, marker_cells
from volery.simulation.world.rasteriser import CameraView, Lens, Rasteriser
from volery.simulation.world.scene import DUSK_LUX, Marker, Solid

BOXES = 240  # of ten triangles each
HEIGHT = 12.0
DOWN = np.diag((1.0, -1.0, -1.0))


def city() -> list[tuple[float, float, float, float]]:
    """Return the boxes: centre east and north, half a side, half the height [m]."""
    random = Random(1)
    found: list[tuple[float, float, float, float]] = []
    while len(found) < BOXES:
        east, north = random.uniform(-40.0, 40.0), random.uniform(-40.0, 40.0)
        if max(abs(east), abs(north)) > 5.0:
            found.append((east, north, random.uniform(1.0, 3.0), random.uniform(1.0, 5.0)))
    return found


def solids() -> list[Solid]:
    """Return the boxes as solids."""
    corners = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    return [
        Solid("box", tuple((east + half * x, north + half * y) for x, y in corners), 0.0, 2.0 * tall)
        for east, north, half, tall in city()
    ]


def rays() -> Callable[[], object]:
    """Return a function that meets the boxes with one ray a pixel."""
    boxes = "".join(
        f'<geom type="box" pos="{east} {north} {tall}" size="{half} {half} {tall}"/>'
        for east, north, half, tall in city()
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{boxes}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lens = Lens()
    lines = np.concatenate((lens.sight_lines(), np.ones((lens.height, lens.width, 1))), axis=2)
    along = (lines.reshape(-1, 3) @ DOWN.T).reshape(-1)
    count = lens.width * lens.height
    solid, far = np.zeros(count, dtype=np.int32), np.zeros(count)
    at = np.array((0.0, 0.0, HEIGHT))
    return lambda: mujoco.mj_multiRay(model, data, at, along, None, 1, -1, solid, far, None, count, 1e3)


def timed(call: Callable[[], object], rounds: int) -> float:
    """Return the least CPU time of a call [ms]."""
    call()
    found = []
    for _ in range(rounds):
        start = process_time()
        call()
        found.append(process_time() - start)
    return 1e3 * min(found)


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=30)
    rounds = parser.parse_args().rounds
    marker = Marker("pad", marker_cells("36h11", 7), (0.0, 0.0, 0.0), 1.0)
    bent = Lens(distortion=(-0.2, 0.05, 0.001, -0.001, 0.0))
    plain = Rasteriser(Lens(), solids(), [marker])
    full = Rasteriser(bent, solids(), [marker], noise=np.uint64(1))
    still = CameraView((0.0, 0.0, HEIGHT), DOWN)
    moving = CameraView((0.0, 0.0, HEIGHT), DOWN, (3.0, 1.0, 0.5), (0.3, 0.3, 0.2))
    times = [
        timed(lambda: plain.draw(still, 0.0), rounds),
        timed(lambda: full.draw(moving, 0.0, DUSK_LUX), rounds),
        timed(rays(), min(rounds, 5)),
    ]
    picture = plain.draw(still, 0.0)
    camera = CameraModel(np.array([(240.0, 0.0, 159.5), (0.0, 240.0, 119.5), (0.0, 0.0, 1.0)]), np.zeros(5))
    finder = MarkerFinder({7: 1.0})
    print(f"plain                              {times[0]:7.2f} ms")
    print(f"lens, motion blur, exposure, noise {times[1]:7.2f} ms")
    ratios = f"{times[0] / times[2]:.3f} and {times[1] / times[2]:.3f} of it"
    print(f"one ray a pixel by MuJoCo          {times[2]:7.2f} ms: the pictures take {ratios}")
    print(f"finding the marker                 {timed(lambda: finder.find(picture, camera), rounds):7.2f} ms")


if __name__ == "__main__":
    main()
