"""Exploration: to one frontier after the other, until all that can be reached is known.

It is cautious: paths keep their distance from what is not known as from obstacles, so whatever comes into
sight is in sight before it is near. Speed, acceleration and yaw rate are limited, for a matcher of scans.
"""

from __future__ import annotations

from math import ceil, hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.avoidance import Motion
from volery.autonomy.frontiers import edges_of, frontiers_of, reach_of
from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.navigator import Navigator
from volery.autonomy.planar_pose import Array, Pose2
from volery.base.elementary import atan2
from volery.base.frames import wrap
from volery.base.metered_work import done
from volery.base.time import Ns, S

_LOOK: Ns = 2 * S
"""Time between two choices of a frontier."""
_FIRST: Ns = 2 * S
"""Time for which it looks around before the first: a cell is free after some scans."""


class ExplorationCommand(NamedTuple):
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
    ``given_up`` are goals [m] that led to nothing: what is not known near them stays so.

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
        self._updated: Ns = 0
        self._waited = False  # at the goal since the last choice
        self._found_none = False  # by the last choice; by the next one, too, it is done

    def update(self, time: Ns, pose: Pose2, scan: LaserScan2 | None, velocity: Array) -> ExplorationCommand:
        """Return what to command; the arguments are those of ``Navigator.update``."""
        navigator = self.navigator
        done("exploration")
        command = navigator.update(time, pose, scan, velocity)
        if self._began is None and len(navigator.grid.log_odds):
            self._began = time
        if time < self._updated:  # a clock that jumped back
            self._looked = self._until = time
            self._began = time if self._began is None else min(self._began, time)
        elif navigator.fault:  # the goal is not to blame
            self._until += time - self._updated
        self._updated = time
        if self._began is None or time - self._began < _FIRST or self.done or navigator.fault:
            return ExplorationCommand(np.zeros(2), 0.0)
        came = navigator.arrived and not self._waited
        if navigator.goal is None or came or time - self._looked >= _LOOK:
            self._looked = time
            self._choose(time, pose)
        ahead = hypot(*command)
        off = wrap(atan2(command[1], command[0]) - pose.yaw) if ahead > 0.05 else 0.0
        return ExplorationCommand(command, min(max(2.0 * off, -self.turn), self.turn))

    def _choose(self, time: Ns, pose: Pose2) -> None:
        """Set the goal: stay with the one at hand while a frontier is near it, else take the best."""
        navigator, grid = self.navigator, self.navigator.grid
        goal = navigator.goal
        near = ceil(navigator.least / grid.resolution) + 2
        failed = bool(navigator.no_way) or time > self._until or (navigator.arrived and self._waited)
        self._waited = navigator.arrived
        if goal and failed:
            self.given_up.append(goal)
        free = navigator.free
        edge = edges_of(free, grid.occupied, self._marked(self.given_up), near)
        if goal and not failed and (edge & reach_of(self._marked([goal]), free, near)).any():
            return
        ways, window = navigator.ways_from(np.array((pose.x, pose.y)))
        ways.cost[ways.clearance < navigator.least] = np.inf  # a way may lead out of there, but not to it
        least = max(4, round(self.gap / grid.resolution))
        found = frontiers_of(edge, free, ways, near, least)
        if not found:
            self.done, navigator.goal = self._found_none, None
            self._found_none = True
            if self.done:
                navigator.word = f"explored; {len(self.given_up)} places led to nothing"
            return
        self._found_none = False
        x, y = (float(value) for value in window.centres(np.array((found[0].goal,)))[0])
        navigator.goal = x, y
        self._waited = False
        self._until = time + 10 * S + round(3.0 * found[0].cost / navigator.motion.fastest * S)

    def _marked(self, places: list[tuple[float, float]]) -> NDArray[np.bool_]:
        """Return the cells of places."""
        marked = np.zeros(self.navigator.grid.log_odds.shape, dtype=bool)
        for place in places:
            marked[self.navigator.grid.cell(*place)] = True
        return marked
