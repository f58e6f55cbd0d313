"""Dijkstra on a road map: dicts of lists, a heap, tuples."""

from heapq import heappop, heappush
from random import Random


def ways_from(roads, start):
    known = {start: 0.0}
    done = set()
    queue = [(0.0, start)]
    while queue:
        length, place = heappop(queue)
        if place in done:
            continue
        done.add(place)
        for neighbour, distance in roads[place]:
            through = length + distance
            if neighbour not in known or through < known[neighbour]:
                known[neighbour] = through
                heappush(queue, (through, neighbour))
    return known


def prepare(seed):
    random = Random(seed)
    names = [f"place {number}" for number in range(120)]
    roads = {name: [] for name in names}
    for name in names:
        for _ in range(4):
            other = random.choice(names)
            distance = random.uniform(1, 20)
            roads[name].append((other, distance))
            roads[other].append((name, distance))
    return roads


def run(state):
    return sum(len(ways_from(state, f"place {number}")) for number in (0, 40, 80))
