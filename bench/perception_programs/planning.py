"""Ways to six goals through a town of blocks."""

import numpy as np

from volery.autonomy.grid_path import WaysFrom, clearance_of


def prepare(seed):
    random = np.random.default_rng(seed)
    blocked = np.zeros((180, 240), dtype=bool)
    for _ in range(45):
        row, column = random.integers(0, 165), random.integers(0, 225)
        blocked[row : row + random.integers(4, 16), column : column + random.integers(4, 16)] = True
    blocked[85:96, 115:126] = False
    free = np.argwhere(~blocked)
    return blocked, [tuple(map(int, free[at])) for at in random.integers(0, len(free), 6)]


def run(given):
    blocked, goals = given
    ways = WaysFrom(clearance_of(blocked, 0.25), 0.25, (90, 120), 0.4)
    corners = 0
    for goal in goals:
        corners += len(ways.straightened(ways.to(goal)))
    return corners
