"""K means of points in the plane: comprehensions, tuples, min with a key."""

from random import Random


def square(one, other):
    return (one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2


def nearest(point, middles):
    best, found = float("inf"), 0
    for index, middle in enumerate(middles):
        far = square(point, middle)
        if far < best:
            best, found = far, index
    return found


def middle_of(points):
    return sum(x for x, _ in points) / len(points), sum(y for _, y in points) / len(points)


def prepare(seed):
    random = Random(seed)
    return [(random.gauss(0, 3), random.gauss(0, 3)) for _ in range(120)]


def run(state):
    middles = state[:4]
    for _ in range(5):
        groups = [[] for _ in middles]
        for point in state:
            groups[nearest(point, middles)].append(point)
        middles = [middle_of(group) if group else old for group, old in zip(groups, middles, strict=True)]
    return [min(middles, key=lambda middle: square(middle, point)) for point in state[:50]]
