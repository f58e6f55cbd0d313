"""Points of a scan gathered into clusters by a grid of cells, and each cluster's middle and extent."""

from collections import defaultdict
from random import Random


def cell_of(point, size):
    return int(point[0] // size), int(point[1] // size)


def cluster(points, size):
    cells = defaultdict(list)
    for point in points:
        cells[cell_of(point, size)].append(point)
    seen, found = set(), []
    for first in cells:
        if first in seen:
            continue
        seen.add(first)
        stack, members = [first], []
        while stack:
            here = stack.pop()
            members.extend(cells[here])
            x, y = here
            for there in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
                if there in cells and there not in seen:
                    seen.add(there)
                    stack.append(there)
        found.append(members)
    return found


def describe(members):
    east = [x for x, _ in members]
    north = [y for _, y in members]
    return sum(east) / len(east), sum(north) / len(north), max(east) - min(east), max(north) - min(north)


def prepare(seed):
    random = Random(seed)
    centres = [(random.uniform(-15, 15), random.uniform(-15, 15)) for _ in range(12)]
    return [(x + random.gauss(0, 0.4), y + random.gauss(0, 0.4)) for x, y in centres for _ in range(150)]


def run(state):
    found = [describe(members) for members in cluster(state, 0.5) if len(members) >= 4]
    return len(found), max(extent for _, _, extent, _ in found)
