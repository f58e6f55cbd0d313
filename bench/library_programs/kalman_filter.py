"""A Kalman filter of six states with matrices of numpy."""

import numpy as np


def run(seed):
    rng = np.random.default_rng(seed)
    step = 0.1
    motion = np.eye(6)
    motion[:3, 3:] = step * np.eye(3)
    seen = np.zeros((3, 6))
    seen[:3, :3] = np.eye(3)
    process, noise = 0.01 * np.eye(6), 0.5 * np.eye(3)
    state, spread = np.zeros(6), np.eye(6)
    track = []
    for k in range(120):
        measured = np.array([k * step, 2.0, 1.0]) + rng.normal(0.0, 0.3, 3)
        state = motion @ state
        spread = motion @ spread @ motion.T + process
        surprise = measured - seen @ state
        weight = seen @ spread @ seen.T + noise
        gain = spread @ seen.T @ np.linalg.inv(weight)
        state = state + gain @ surprise
        spread = (np.eye(6) - gain @ seen) @ spread
        if float(surprise @ np.linalg.solve(weight, surprise)) < 16.0:
            track.append((state[0], state[1], np.linalg.norm(state[3:])))
    return len(track)


def prepare(seed):
    return seed
