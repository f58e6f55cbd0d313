"""Time of a scan among boxes, against MuJoCo's ray casting (mj_multiRay) on the same boxes and beams.

Both end a beam at the same length, and each distance must agree within a millimetre. A beam starts in the
open, one metre up. The goals are ratios of 8 with 195 boxes and of 5 with 1,250 (5,000 edges).

    python bench/perception.py [--beams 720] [--rounds 5]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from time import perf_counter

import mujoco
import numpy as np

from volery.simulation.added_sensors.beams import BeamSampler, Ranging
from volery.simulation.added_sensors.lidar import Lidar
from volery.simulation.world.scene import Scene, Solid
from volery.simulation.world.sensors import SensorInput
from volery.simulation.world.state_layout import Array

SCENES = {"a room of 195 boxes": (195, 30.0), "195 boxes": (195, 60.0), "1,250 boxes": (1250, 150.0)}
"""Number of boxes, and half the side of the square that they stand in [m]."""
REACH = 30.0
UP = 1.0
CALLS = 50

Boxes = list[tuple[float, float, float, float]]


def boxes(count: int, half: float) -> Boxes:
    """Return centres and half sides (east, north) of boxes that leave a metre about the origin free."""
    random = np.random.default_rng(1)
    found: Boxes = []
    while len(found) < count:
        east, north = random.uniform(-half, half, 2)
        wide, high = random.uniform(0.2, 1.0, 2)
        if max(abs(east) - wide, abs(north) - high) > 1.0:
            found.append((float(east), float(north), float(wide), float(high)))
    return found


def ours(stand: Boxes, lidar: Lidar) -> tuple[Callable[[], None], Array]:
    """Return a scan of the simulation and its ranges, which each scan overwrites."""
    solids = [
        Solid("box", ((e - w, n - h), (e + w, n - h), (e + w, n + h), (e - w, n + h)), -1.0, 3.0)
        for e, n, w, h in stand
    ]
    scene, still, level = Scene(solids), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    sampler = BeamSampler(lidar, np.uint64(0), scene)
    sampler(
        SensorInput(0, (0.0, 0.0, UP), still, level, still, still, still, 0.0, scene),
        0,
    )
    return sampler.cast, sampler.readings


def theirs(stand: Boxes, lidar: Lidar) -> tuple[Callable[[], None], Array]:
    """Return a scan of MuJoCo and its ranges, -1 where nothing is met."""
    geoms = "".join(f'<geom type="box" pos="{e} {n} 1" size="{w} {h} 2"/>' for e, n, w, h in stand)
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ways = lidar.beams().reshape(-1)
    start, ids, ranges = np.array([0.0, 0.0, UP]), np.zeros(lidar.columns, np.int32), np.zeros(lidar.columns)

    def scan() -> None:
        mujoco.mj_multiRay(model, data, start, ways, None, True, -1, ids, ranges, None, lidar.columns, REACH)

    return scan, ranges


def shortest(scan: Callable[[], None]) -> float:
    """Return the time of a scan [s], the mean of ``CALLS``."""
    start = perf_counter()
    for _ in range(CALLS):
        scan()
    return (perf_counter() - start) / CALLS


def main() -> None:
    """Print both times, their ratio and the largest difference."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--beams", type=int, default=720)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    lidar = Lidar("lidar", 10.0, Ranging(0.0, REACH), options.beams, 2.0 * np.pi)
    for name, (count, half) in SCENES.items():
        stand = boxes(count, half)
        (scan, ranges), (other, others) = ours(stand, lidar), theirs(stand, lidar)
        times = [(shortest(scan), shortest(other)) for _ in range(options.rounds)]
        mine, mujocos = (min(column) for column in zip(*times, strict=True))
        met = (others >= 0.0) & (others < REACH)
        assert (np.isfinite(ranges) == met).all(), "a beam ends in one of them only"
        apart = abs(ranges[met] - others[met]).max()
        assert apart < 0.001, f"{apart} m apart"
        print(
            f"{name}: {1e6 * mine:.0f} us a scan of {options.beams} beams, MuJoCo {mujoco.__version__} "
            f"{1e6 * mujocos:.0f} us: {mujocos / mine:.0f} times as fast, {100 * met.mean():.0f} % of "
            f"the beams meet a box, at most {1000 * apart:.1g} mm apart"
        )


if __name__ == "__main__":
    main()
