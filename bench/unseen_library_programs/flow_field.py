"""Optical flow after Lucas and Kanade: gradients of two pictures, sums over windows, two by two systems."""

import numpy as np


def prepare(seed):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:72, 0:96]
    first = np.sin(x / 5.0 + seed) * np.cos(y / 7.0) + 0.05 * rng.normal(size=x.shape)
    second = np.sin((x - 0.6) / 5.0 + seed) * np.cos((y + 0.3) / 7.0)
    return first.astype(np.float32), second.astype(np.float32)


def window(values, half):
    padded = np.pad(values, half)
    summed = np.zeros_like(values)
    for dy in range(2 * half + 1):
        for dx in range(2 * half + 1):
            summed += padded[dy : dy + values.shape[0], dx : dx + values.shape[1]]
    return summed


def run(pictures):
    first, second = pictures
    gy, gx = np.gradient(first)
    gt = second - first
    xx, yy, xy = (window(part, 2) for part in (gx * gx, gy * gy, gx * gy))
    xt, yt = window(gx * gt, 2), window(gy * gt, 2)
    det = xx * yy - xy * xy
    good = det > 1e-3
    safe = np.where(good, det, np.float32(1.0))
    u = np.where(good, (xy * yt - yy * xt) / safe, 0.0)
    v = np.where(good, (xy * xt - xx * yt) / safe, 0.0)
    moving = np.sqrt(u * u + v * v) > 0.2
    rows, columns = np.nonzero(moving)
    return float(u[moving].mean()) + float(np.median(v[good])) + int(rows.sum()) + int(columns.max())
