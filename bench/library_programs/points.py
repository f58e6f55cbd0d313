"""Nearest obstacle and occupancy of a cloud of points."""

import numpy as np


def run(seed):
    rng = np.random.default_rng(seed)
    cloud = rng.uniform(-20.0, 20.0, (3000, 3))
    nearest = 0.0
    for k in range(8):
        place = np.array([k * 1.0, 0.5 * k, 2.0])
        distance = np.sqrt(((cloud - place) ** 2).sum(axis=1))
        order = np.argsort(distance)[:10]
        nearest += float(distance[order].mean())
        cells = np.floor(cloud / 2.0).astype(int)
        grid = np.zeros((20, 20))
        near = cells[(np.abs(cloud[:, 2]) < 3.0) & (distance < 15.0)]
        grid[near[:, 0] % 20, near[:, 1] % 20] = 1.0
        nearest += grid.sum() * 1e-3
    return nearest


def prepare(seed):
    return seed
