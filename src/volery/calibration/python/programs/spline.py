"""A smooth way through points, and how fast it may be driven: float expressions, early returns, clamps."""

from math import hypot
from random import Random


def clamp(value, low, high):
    if value < low:
        return low
    if value > high:
        return high
    return value


def blend(p0, p1, p2, p3, t):
    t2 = t * t
    t3 = t2 * t
    return 0.5 * (
        2 * p1 + (p2 - p0) * t + (2 * p0 - 5 * p1 + 4 * p2 - p3) * t2 + (3 * p1 - p0 - 3 * p2 + p3) * t3
    )


def sample(points, parts):
    way = []
    for index in range(1, len(points) - 2):
        before, start, end, after = points[index - 1 : index + 3]
        for part in range(parts):
            t = part / parts
            x = blend(before[0], start[0], end[0], after[0], t)
            y = blend(before[1], start[1], end[1], after[1], t)
            way.append((x, y))
    return way


def speeds(way, fastest):
    found = [0.0]
    for before, here, after in zip(way, way[1:], way[2:], strict=False):
        ax, ay = here[0] - before[0], here[1] - before[1]
        bx, by = after[0] - here[0], after[1] - here[1]
        bend = abs(ax * by - ay * bx) / (hypot(ax, ay) * hypot(bx, by) + 1e-9)
        found.append(clamp(fastest * (1.0 - bend), 0.2, found[-1] + 0.1))
    return found


def prepare(seed):
    random = Random(seed)
    return [(number + random.random(), random.uniform(-2, 2)) for number in range(30)]


def run(state):
    way = sample(state, 20)
    return sum(speeds(way, 3.0))
