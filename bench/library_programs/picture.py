"""Detection of a bright marker in pictures of 320 x 240."""

import numpy as np


def run(seed):
    rng = np.random.default_rng(seed)
    found = 0.0
    for _ in range(4):
        picture = rng.random((240, 320))
        picture[100:120, 150:180] += 2.0
        blurred = (
            picture[1:-1, 1:-1] * 4 + picture[:-2, 1:-1] + picture[2:, 1:-1] + picture[1:-1, :-2]
        ) / 7.0
        limit = blurred.mean() + 3.0 * blurred.std()
        mask = blurred > limit
        rows, columns = np.nonzero(mask)
        if rows.size:
            found += rows.mean() + columns.mean()
        edges = np.abs(np.diff(blurred, axis=1)).sum()
        found += edges * 1e-6 + float(np.clip(blurred, 0.1, 0.9).max())
    return found


def prepare(seed):
    return seed
