"""A laser's points are moved to the frame of the map, thinned to one per voxel, and split by height."""

import numpy as np


def prepare(seed):
    rng = np.random.default_rng(seed)
    points = rng.random((6000, 3), dtype=np.float32) * np.float32(20.0)
    points[:4000, 2] *= np.float32(0.01)
    return points


def run(points):
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]], dtype=np.float32)
    moved = points @ turn.T + np.array([1.0, 2.0, 0.0], dtype=np.float32)
    voxels = np.floor(moved * np.float32(2.0)).astype(np.int32)
    keys = voxels[:, 0] * 10000 + voxels[:, 1] * 100 + voxels[:, 2]
    unique, first, counts = np.unique(keys, return_index=True, return_counts=True)
    thinned = moved[first]
    ground = thinned[:, 2] < 0.3
    obstacles = thinned[~ground]
    height = np.percentile(obstacles[:, 2], 90)
    cells = np.bincount(np.clip(voxels[:, 0] + 40, 0, 99), minlength=100)
    return float(height) + int(counts.max()) + int(cells.argmax()) + len(unique)
