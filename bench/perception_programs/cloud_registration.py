"""Two clouds of a room that are brought together by small_gicp."""

import numpy as np
import small_gicp


def prepare(seed):
    random = np.random.default_rng(seed)
    cloud = random.uniform(-6.0, 6.0, (6000, 3))
    side = random.integers(0, 3, 6000)
    cloud[np.arange(6000), side] = np.where(random.random(6000) < 0.5, -6.0, 6.0)
    return cloud, cloud[1000:] + np.array((0.15, -0.1, 0.05))


def run(given):
    target, tree = small_gicp.preprocess_points(given[0], 0.3, 10, 1)
    source, _ = small_gicp.preprocess_points(given[1], 0.3, 10, 1)
    found = small_gicp.align(target, source, tree)
    return float(found.T_target_source[0, 3])
