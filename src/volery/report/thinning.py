"""Fewer points that look the same: what keeps a report of a long run small.

Two ways for two purposes. A track keeps the points without which a vehicle, moved evenly from point to point,
would be more than a tolerance from where it was at that time (top-down time ratio, Meratnia and de By,
*Spatiotemporal Compression Techniques for Moving Point Objects*, EDBT 2004). A curve keeps the smallest and
the largest value of each stretch, so that no peak is lost.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indexes = NDArray[np.int64]


def thin_track(times: Floats, points: Floats, tolerance: float) -> Indexes:
    """Indexes of the points to keep.

    *times* are n ascending seconds, *points* n rows of metres; *tolerance* is in metres.
    """
    count = len(times)
    keep = np.zeros(count, dtype=bool)
    if count == 0:
        return np.flatnonzero(keep)
    keep[[0, count - 1]] = True
    stretches = [(0, count - 1)]
    while stretches:
        first, last = stretches.pop()
        if last - first < 2:
            continue
        worst, distance = _worst(times[first : last + 1], points[first : last + 1])
        if distance > tolerance:
            middle = first + worst
            keep[middle] = True
            stretches += [(first, middle), (middle, last)]
    return np.flatnonzero(keep)


def _worst(times: Floats, points: Floats) -> tuple[int, float]:
    """The inner point that is farthest from even motion between the ends, and how far it is."""
    span = times[-1] - times[0]
    share = (times - times[0]) / span if span > 0 else np.zeros_like(times)
    even = points[0] + share[:, np.newaxis] * (points[-1] - points[0])
    off = ((points - even) ** 2).sum(axis=1)
    worst = int(off[1:-1].argmax()) + 1
    return worst, float(off[worst]) ** 0.5


def thin_curve(values: Floats, stretches: int) -> Indexes:
    """Indexes of the ends of *values* and of the extremes of so many stretches; NaN is skipped."""
    count = len(values)
    if count <= 2 * stretches:
        return np.flatnonzero(~np.isnan(values))
    keep = {0, count - 1}
    edges = [count * index // stretches for index in range(stretches + 1)]
    for first, last in pairwise(edges):
        stretch = values[first:last]
        if not np.isnan(stretch).all():
            keep.add(first + int(np.nanargmin(stretch)))
            keep.add(first + int(np.nanargmax(stretch)))
    found = np.array(sorted(keep), dtype=np.int64)
    return found[~np.isnan(values[found])]
