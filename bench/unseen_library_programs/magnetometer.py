"""A magnetometer is calibrated: an ellipsoid by least squares, its axes, then the headings of all samples."""

import numpy as np


def prepare(seed):
    rng = np.random.default_rng(seed)
    turns = rng.normal(size=(900, 3))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    return (
        turns * np.array([1.2, 0.9, 1.05]) + np.array([0.3, -0.2, 0.1]) + rng.normal(0.0, 0.01, turns.shape)
    )


def run(samples):
    x, y, z = samples.T
    rows = np.stack([x * x, y * y, z * z, x, y, z], axis=1)
    found, *_ = np.linalg.lstsq(rows, np.ones(len(rows)), rcond=None)
    middle = -0.5 * found[3:] / found[:3]
    scale = np.sqrt((1.0 + (found[:3] * middle**2).sum()) / found[:3])
    level = (samples - middle) / scale
    heading = np.degrees(np.arctan2(level[:, 1], level[:, 0])) % 360.0
    counts, edges = np.histogram(heading, bins=36, range=(0.0, 360.0))
    size = np.linalg.norm(level, axis=1)
    bad = np.abs(size - 1.0) > 3.0 * size.std()
    order = np.argsort(heading)
    gaps = np.diff(heading[order])
    smooth = np.convolve(size[order], np.ones(9) / 9.0, mode="same")
    return float(gaps.max() + smooth[4:-4].min() + edges[int(counts.argmax())]) + int(bad.sum())
