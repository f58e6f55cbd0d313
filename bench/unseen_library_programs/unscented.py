"""An unscented Kalman filter of a rover: sigma points from a Cholesky factor, weighted means, gains."""

import numpy as np


def prepare(seed):
    rng = np.random.default_rng(seed)
    return rng.normal(0.0, 0.4, (40, 2)) + np.array([5.0, 3.0])


def points_of(mean, covariance):
    root = np.linalg.cholesky(covariance * 7.0)
    return np.vstack([mean, mean + root.T, mean - root.T])


def move(points, dt):
    after = points.copy()
    after[:, 0] += points[:, 3] * np.cos(points[:, 2]) * dt
    after[:, 1] += points[:, 3] * np.sin(points[:, 2]) * dt
    after[:, 2] += 0.1 * dt
    return after


def run(ranges):
    mean, covariance = np.array([0.0, 0.0, 0.1, 1.0]), np.diag([0.5, 0.5, 0.05, 0.2])
    weights = np.full(9, 0.5 / 7.0)
    weights[0] = 3.0 / 7.0
    noise, spread = np.diag([0.01, 0.01, 0.001, 0.02]), np.eye(2) * 0.16
    beacons = np.array([[5.0, 0.0], [0.0, 3.0]])
    for seen in ranges:
        points = move(points_of(mean, covariance), 0.05)
        mean = weights @ points
        apart = points - mean
        covariance = (apart * weights[:, None]).T @ apart + noise
        expected = np.linalg.norm(points[:, None, :2] - beacons, axis=2)
        middle = weights @ expected
        off = expected - middle
        both = (apart * weights[:, None]).T @ off
        gain = both @ np.linalg.inv((off * weights[:, None]).T @ off + spread)
        mean = mean + gain @ (seen - middle)
        covariance = covariance - gain @ both.T
        covariance = 0.5 * (covariance + covariance.T)
    return float(mean.sum() + np.trace(covariance))
