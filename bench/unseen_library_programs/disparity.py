"""Two rows of a stereo camera are matched block by block; the depth of the best shifts is smoothed."""

import numpy as np


def prepare(seed):
    rng = np.random.default_rng(seed)
    left = rng.integers(0, 256, (96, 128)).astype(np.uint8)
    right = np.roll(left, -5, axis=1)
    right[40:60] = np.roll(left[40:60], -9, axis=1)
    return left.astype(np.int16), right.astype(np.int16)


def run(images):
    left, right = images
    best = np.full(left.shape, 30000, dtype=np.int32)
    found = np.zeros(left.shape, dtype=np.uint8)
    for shift in range(12):
        difference = np.abs(left - np.roll(right, shift, axis=1)).astype(np.int32)
        rows = np.cumsum(difference, axis=0)
        block = rows[5:] - rows[:-5]
        better = block < best[5:]
        best[5:][better] = block[better]
        found[5:][better] = shift
    depth = 120.0 / np.maximum(found.astype(np.float32), 1.0)
    return float(depth.mean()) + int((found == 9).sum())
