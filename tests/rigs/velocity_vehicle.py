"""A vehicle in a plane as ``Motion`` states it: it changes its velocity towards a command, after a delay."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot

import numpy as np

from volery.autonomy.avoidance import Motion
from volery.autonomy.planar_pose import Array, Pose2
from volery.base.time import MS, Ns

STEP: Ns = 10 * MS


def fly(
    decide: Callable[[Ns, Pose2, Array], tuple[Array, float] | None],
    motion: Motion,
    start: Pose2,
    seconds: float,
) -> Array:
    """Return the places (n, 2) and yaws of a flight: (n, 3).

    Args:
        decide: Gives velocity and yaw rate for a time, a pose and a velocity, each ``period``; None ends it.
        motion: What the vehicle can do.
        start: Where it begins, at rest.
        seconds: After which it ends.
    """
    delay, every = round(motion.delay * 1e9 / STEP), round(motion.period * 1e9 / STEP)
    place, yaw, velocity = np.array(start[:2]), start.yaw, np.zeros(2)
    commands, poses = [(velocity, 0.0)] * delay, [(*place, yaw)]
    command: tuple[Array, float] | None = (velocity, 0.0)
    step = STEP / 1e9
    for tick in range(round(seconds / step)):
        if tick % every == 0:
            command = decide(tick * STEP, Pose2(*place, yaw), velocity)
            if command is None:
                break
        commands.append(command)
        wanted, rate = commands.pop(0)
        change = wanted - velocity
        after = velocity + change * min(1.0, motion.acceleration * step / max(hypot(*change), 1e-12))
        place, velocity, yaw = place + 0.5 * step * (velocity + after), after, yaw + rate * step
        poses.append((*place, yaw))
    return np.array(poses)


def distances(walls: Array, places: Array) -> Array:
    """Return how far places (n, 2) are from the nearest wall [m]."""
    found = np.full(len(places), np.inf)
    for wall in walls:
        side = wall[2:] - wall[:2]
        share = np.clip((places - wall[:2]) @ side / (side @ side), 0.0, 1.0)
        found = np.minimum(found, np.hypot(*(places - wall[:2] - share[:, None] * side).T))
    return found
