"""A grid of log odds is updated by beams as masks, blurred by shifts and made into probabilities."""

import numpy as np


def prepare(seed):
    random = np.random.default_rng(seed)
    return random.normal(0.0, 1.0, (120, 120)), random.uniform(0.0, 2.0 * np.pi, 24)


def run(state):
    grid, beams = state
    rows, columns = np.meshgrid(np.arange(120.0) - 60.0, np.arange(120.0) - 60.0, indexing="ij")
    bearing, distance = np.arctan2(rows, columns), np.hypot(rows, columns)
    odds = grid.copy()
    for beam in beams:
        near = np.abs((bearing - beam + np.pi) % (2.0 * np.pi) - np.pi) < 0.03
        odds[near & (distance < 40.0)] -= 0.4
        odds[near & (np.abs(distance - 41.0) < 1.5)] += 0.9
    np.clip(odds, -5.0, 5.0, out=odds)
    blurred = (
        odds[1:-1, 1:-1] * 4.0 + odds[:-2, 1:-1] + odds[2:, 1:-1] + odds[1:-1, :-2] + odds[1:-1, 2:]
    ) / 8.0
    return float(np.mean(1.0 / (1.0 + np.exp(-blurred))))
