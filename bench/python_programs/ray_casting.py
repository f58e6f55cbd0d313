"""A lidar's ranges among walls given as segments."""

from math import cos, pi, sin
from random import Random


def cast(walls, x, y, angle, reach):
    dx, dy = cos(angle), sin(angle)
    nearest = reach
    for x1, y1, x2, y2 in walls:
        ex, ey = x2 - x1, y2 - y1
        across = dx * ey - dy * ex
        if abs(across) < 1e-12:
            continue
        fx, fy = x1 - x, y1 - y
        along = (fx * ey - fy * ex) / across
        if along < 0.0 or along > nearest:
            continue
        share = (fx * dy - fy * dx) / across
        if 0.0 <= share <= 1.0:
            nearest = along
    return nearest


def prepare(seed):
    random = Random(seed)
    walls = []
    for _ in range(40):
        x, y = random.uniform(-20, 20), random.uniform(-20, 20)
        walls.append((x, y, x + random.uniform(-5, 5), y + random.uniform(-5, 5)))
    return walls


def run(state):
    ranges = [cast(state, 0.5, -0.3, 2 * pi * beam / 270, 30.0) for beam in range(270)]
    return min(ranges), sum(ranges)
