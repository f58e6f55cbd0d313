"""Exploration: to one frontier after the other, until all that can be reached is known.

It is cautious: paths keep their distance from what is not known as from obstacles, so whatever comes into
sight is in sight before it is near. Speed, acceleration and yaw rate are limited, for a matcher of scans.
"""

from __future__ import annotations

from math import ceil, hypot
from typing import NamedTuple

import numpy as np

from volery.autonomy.avoidance import Motion
from volery.autonomy.frontiers import frontiers_of
from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.navigator import Navigator
from volery.autonomy.planar_pose import Array, Pose2
from volery.base.elementary import atan2
from volery.base.frames import wrap
from volery.base.time import Ns, S

_LOOK: Ns = 2 * S
"""Time between two choices of a frontier."""
_FIRST: Ns = 2 * S
"""Time for which it looks around before the first: a cell is free after some scans."""
_SAME = 0.5  # [m] a goal nearer than this to one that was given up is the same


class Command(NamedTuple):
    """What to command.

    Args:
        velocity: Velocity in the axes of the map (2,) [m/s].
        yaw_rate: Rate of the yaw [rad/s].
    """

    velocity: Array
    yaw_rate: float


class Explorer:
    """Leads a vehicle through what it does not know.

    Args:
        motion: What the vehicle can do.
        resolution: Side of a cell of the map [m].
        turn: Largest yaw rate [rad/s].
        gap: Frontiers that are shorter are of no use [m].

    ``navigator`` has the map and the word on what it does; ``done`` says that no frontier is left;
    ``given_up`` are places [m] near frontiers that stayed.

    Example::

        explorer = Explorer(Motion(radius=0.35, speed=1.0, acceleration=1.5, sight=12.0))
        while not explorer.done:
            command = explorer.update(now, pose, scan, velocity)
    """

    def __init__(self, motion: Motion, resolution: float = 0.1, turn: float = 0.6, gap: float = 0.6) -> None:
        self.navigator = Navigator(motion, resolution=resolution, cautious=True)
        self.turn, self.gap = turn, gap
        self.done = False
        self.given_up: list[tuple[float, float]] = []
        self._began: Ns | None = None
        self._looked: Ns = 0
        self._until: Ns = 0
        self._waited = False  # at the goal since the last choice

    def update(self, time: Ns, pose: Pose2, scan: LaserScan2 | None, velocity: Array) -> Command:
        """Return what to command; the arguments are those of ``Navigator.update``."""
        navigator = self.navigator
        command = navigator.update(time, pose, scan, velocity)
        if self._began is None and len(navigator.grid.log_odds):
            self._began = time
        if self._began is None or time - self._began < _FIRST or self.done:
            return Command(np.zeros(2), 0.0)
        came = navigator.arrived and not self._waited
        if navigator.goal is None or came or time - self._looked >= _LOOK:
            self._looked = time
            self._choose(time, pose)
        ahead = hypot(*command)
        off = wrap(atan2(command[1], command[0]) - pose.yaw) if ahead > 0.05 else 0.0
        return Command(command, min(max(2.0 * off, -self.turn), self.turn))

    def _choose(self, time: Ns, pose: Pose2) -> None:
        """Set the goal: stay with the frontier at hand while it is one, else take the best."""
        navigator, grid = self.navigator, self.navigator.grid
        goal = navigator.goal
        failed = bool(navigator.no_way) or time > self._until or (navigator.arrived and self._waited)
        self._waited = navigator.arrived
        ways, window = navigator.ways_from(np.array((pose.x, pose.y)))
        near = ceil(navigator.least / grid.resolution) + 2
        least = max(4, round(self.gap / grid.resolution))
        left = []
        for frontier in frontiers_of(navigator.free, grid.log_odds == 0.0, ways, near, least):
            x, y = (float(value) for value in window.centres(np.array((frontier.goal,)))[0])
            if goal and failed and hypot(x - goal[0], y - goal[1]) < _SAME:
                self.given_up.append((x, y))
            if all(hypot(x - was_x, y - was_y) >= _SAME for was_x, was_y in self.given_up):
                left.append(((x, y), frontier))
        if goal and not failed and any(hypot(x - goal[0], y - goal[1]) < 2.0 * _SAME for (x, y), _ in left):
            return
        if not left:
            self.done, navigator.goal = True, None
            navigator.word = f"explored; {len(self.given_up)} frontiers given up"
            return
        navigator.goal, best = left[0]
        self._waited = False
        self._until = time + 10 * S + round(3.0 * best.cost / navigator.motion.fastest * S)
