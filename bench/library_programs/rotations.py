"""Attitudes by rotation matrices of numpy, in a control loop."""

import numpy as np


def matrix(roll, pitch, yaw):
    cr, sr, cp, sp, cy, sy = (
        np.cos(roll),
        np.sin(roll),
        np.cos(pitch),
        np.sin(pitch),
        np.cos(yaw),
        np.sin(yaw),
    )
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def run(seed):
    force = np.zeros(3)
    for k in range(150):
        turn = matrix(0.01 * k, 0.02, seed * 0.1)
        body = turn.T @ np.array([0.3, -0.2, 9.81])
        wanted = np.cross(body, [0.0, 0.0, 1.0])
        force = force * 0.9 + 0.1 * wanted
        if np.linalg.norm(force) > 5.0:
            force = force / np.linalg.norm(force)
    return float(force[0])


def prepare(seed):
    return seed
