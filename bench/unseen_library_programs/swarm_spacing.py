"""Drones of a swarm keep their distance: all pairs, forces of the near ones, limits, energy of the result."""

import numpy as np


def prepare(seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(-30.0, 30.0, (60, 3)), rng.normal(0.0, 0.5, (60, 3))


def run(state):
    place, speed = state[0].copy(), state[1].copy()
    closest = np.inf
    for _ in range(10):
        apart = place[:, None, :] - place[None, :, :]
        distance = np.sqrt(np.einsum("ijk,ijk->ij", apart, apart))
        np.fill_diagonal(distance, np.inf)
        near = distance < 12.0
        strength = np.where(near, (12.0 - distance) / 12.0, 0.0)
        push = np.sum(apart / distance[:, :, None] * strength[:, :, None], axis=1)
        speed = 0.95 * speed + 0.1 * push
        fast = np.linalg.norm(speed, axis=1, keepdims=True)
        speed = np.where(fast > 2.0, speed * 2.0 / np.maximum(fast, 1e-9), speed)
        place += speed * 0.1
        closest = min(closest, float(distance.min()))
    return closest + float((speed**2).sum()) + float(np.ptp(place[:, 2]))
