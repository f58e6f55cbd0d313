"""Two scans of a lidar are aligned: nearest neighbours by all distances, rotation by a decomposition."""

import numpy as np


def prepare(seed):
    random = np.random.default_rng(seed)
    first = random.uniform(-8.0, 8.0, (160, 2))
    angle = 0.1
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return first, first @ turn.T + np.array([0.3, -0.2]) + random.normal(0.0, 0.01, first.shape)


def run(scans):
    first, second = scans
    moved = first
    for _ in range(8):
        apart = moved[:, None, :] - second[None, :, :]
        nearest = second[np.argmin(np.sum(apart**2, axis=2), axis=1)]
        here, there = np.mean(moved, axis=0), np.mean(nearest, axis=0)
        left, _, right = np.linalg.svd((moved - here).T @ (nearest - there))
        turn = right.T @ left.T
        moved = (moved - here) @ turn.T + there
    return float(np.sum(moved))
