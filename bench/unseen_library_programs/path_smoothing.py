"""A path is resampled by its length, smoothed by small linear systems, and checked for its curvature."""

import numpy as np


def prepare(seed):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(0.0, 3.0, (40, 2)), axis=0)


def run(points):
    legs = np.diff(points, axis=0)
    along = np.concatenate(([0.0], np.cumsum(np.sqrt((legs**2).sum(axis=1)))))
    at = np.linspace(0.0, along[-1], 120)
    path = np.stack((np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])), axis=1)
    for start in range(0, 112, 8):
        part = path[start : start + 8]
        second = np.diff(np.eye(8), n=2, axis=0)
        path[start : start + 8] = np.linalg.solve(np.eye(8) + 0.5 * second.T @ second, part)
    velocity = np.gradient(path, axis=0)
    change = np.gradient(velocity, axis=0)
    turning = velocity[:, 0] * change[:, 1] - velocity[:, 1] * change[:, 0]
    speed = np.linalg.norm(velocity, axis=1)
    curvature = np.abs(turning) / np.maximum(speed, 1e-6) ** 3
    worst = int(np.argmax(curvature))
    for point in path[::10]:
        nearest = np.argmin(((points - point) ** 2).sum(axis=1))
        worst += int(nearest)
    return worst + float(np.median(curvature))
