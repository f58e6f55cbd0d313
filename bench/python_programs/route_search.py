"""A* on a grid with obstacles."""

import heapq
from random import Random

NEIGHBOURS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1))


def distance(a, b):
    dx, dy = abs(a[0] - b[0]), abs(a[1] - b[1])
    return max(dx, dy) + 0.4142 * min(dx, dy)


def search(blocked, size, start, goal):
    waiting = [(distance(start, goal), 0.0, start)]
    came_from = {start: None}
    cost = {start: 0.0}
    closed = set()
    while waiting:
        _, so_far, here = heapq.heappop(waiting)
        if here == goal:
            break
        if here in closed:
            continue
        closed.add(here)
        for dx, dy in NEIGHBOURS:
            there = here[0] + dx, here[1] + dy
            if not (0 <= there[0] < size and 0 <= there[1] < size) or there in blocked:
                continue
            new = so_far + (1.4142 if dx and dy else 1.0)
            if there not in cost or new < cost[there]:
                cost[there] = new
                came_from[there] = here
                heapq.heappush(waiting, (new + distance(there, goal), new, there))
    path, here = [], goal if goal in came_from else None
    while here is not None:
        path.append(here)
        here = came_from[here]
    return path[::-1]


def prepare(seed):
    random = Random(seed)
    size = 48
    blocked = {(random.randrange(size), random.randrange(size)) for _ in range(600)}
    blocked -= {(0, 0), (size - 1, size - 1)}
    return blocked, size


def run(state):
    blocked, size = state
    return len(search(blocked, size, (0, 0), (size - 1, size - 1)))
