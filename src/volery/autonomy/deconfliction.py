"""Paths of several vehicles that keep apart: who starts later, or flies higher.

Vehicles are served in their order: each takes the smallest delay, and with it the lowest level, with which
it keeps its distance from all before it (prioritised planning: Erdmann and Lozano-Perez 1987). Before its
start a vehicle stands where its path begins, afterwards where it ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planar_pose import Array
from volery.base.errors import UsageError
from volery.base.time import Ns, S


class TimedPath(NamedTuple):
    """A path with times; between two of them it is straight and of constant speed.

    Args:
        times: Times (n,), ascending [ns].
        positions: Positions (n, 3): east, north, up [m].
    """

    times: NDArray[np.int64]
    positions: Array

    def shifted(self, delay: Ns, higher: float) -> TimedPath:
        """Return the same path later and higher [m]."""
        return TimedPath(self.times + delay, self.positions + np.array((0.0, 0.0, higher)))


class Slot(NamedTuple):
    """When and at which level a vehicle flies its path.

    Args:
        delay: Time after which it starts [ns].
        level: Number of levels by which it flies higher.
    """

    delay: Ns
    level: int


def least_distance(one: TimedPath, other: TimedPath) -> float:
    """Return the smallest distance of two vehicles at the same time [m]."""
    times = np.union1d(one.times, other.times)
    apart = _at(one, times) - _at(other, times)
    before, change = apart[:-1], np.diff(apart, axis=0)
    square = (change * change).sum(axis=1)
    share = np.clip(-(before * change).sum(axis=1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    nearest = np.vstack((before + share[:, None] * change, apart[-1:]))
    return float(np.sqrt((nearest * nearest).sum(axis=1).min()))


def deconflicted(
    paths: Mapping[str, TimedPath],
    distance: float,
    levels: int = 1,
    apart: float = 0.0,
    longest: Ns = 600 * S,
    step: Ns = S,
) -> dict[str, Slot]:
    """Return delay and level of each vehicle.

    Args:
        paths: The path of each vehicle by name; those before have the right of way.
        distance: Distance that vehicles keep [m].
        levels: Number of levels of altitude.
        apart: Height of a level above the one below it [m].
        longest: Longest delay that is tried.
        step: Step of the delays that are tried.

    Raises:
        UsageError: A path is not one, the figures make no sense, or no delay and level keep a vehicle apart.
    """
    if not (distance > 0.0 and levels >= 1 and step > 0 and longest >= 0 and (levels == 1 or apart > 0.0)):
        raise UsageError(
            f"{levels} levels {apart:g} m apart, {distance:g} m between vehicles: give a distance and a step "
            "above 0, and levels that are apart"
        )
    found: dict[str, Slot] = {}
    placed: dict[str, TimedPath] = {}
    for name, given in paths.items():
        path = _checked(name, given)
        slots = (Slot(delay, level) for delay in range(0, longest + 1, step) for level in range(levels))
        nearest, blocking = -inf, ""
        for slot in slots:
            shifted = path.shifted(slot.delay, slot.level * apart)
            away, other = min(
                ((least_distance(shifted, before), who) for who, before in placed.items()), default=(inf, "")
            )
            if away >= distance:
                found[name], placed[name] = slot, shifted
                break
            if away > nearest:
                nearest, blocking = away, other
        else:
            raise UsageError(
                f"{name} comes within {nearest:.1f} m of {blocking} with every delay up to {longest / S:g} s "
                f"on {levels} levels; give more levels, other places of start and end, or put it before "
                f"{blocking}"
            )
    return found


def _at(path: TimedPath, times: NDArray[np.int64]) -> Array:
    """Return where a vehicle is at some times (n, 3)."""
    first = path.times[0]
    since, known = (times - first).astype(np.float64), (path.times - first).astype(np.float64)
    return np.stack([np.interp(since, known, path.positions[:, axis]) for axis in range(3)], axis=1)


def _checked(name: str, given: TimedPath) -> TimedPath:
    times = np.asarray(given.times, dtype=np.int64)
    path = TimedPath(times, np.asarray(given.positions, dtype=np.float64))
    fits = path.positions.shape == (len(times), 3) and len(times) > 0
    if not fits or not np.isfinite(path.positions).all() or (np.diff(times) <= 0).any():
        raise UsageError(f"{name}: give ascending times [ns] and as many finite positions (n, 3) [m]")
    return path
