"""A tree of squares that points are sorted into and looked up from: recursion and optional children."""

from random import Random


class Square:
    capacity = 4

    def __init__(self, x, y, half):
        self.x, self.y, self.half = x, y, half
        self.points = []
        self.children = None

    def insert(self, point):
        if self.children is not None:
            self.child_of(point).insert(point)
            return
        self.points.append(point)
        if len(self.points) > self.capacity and self.half > 0.01:
            self.split()

    def split(self):
        quarter = self.half / 2
        self.children = [
            Square(self.x + dx * quarter, self.y + dy * quarter, quarter) for dx in (-1, 1) for dy in (-1, 1)
        ]
        points, self.points = self.points, []
        for point in points:
            self.child_of(point).insert(point)

    def child_of(self, point):
        return self.children[2 * (point[0] >= self.x) + (point[1] >= self.y)]

    def near(self, x, y, reach, found):
        if abs(x - self.x) > self.half + reach or abs(y - self.y) > self.half + reach:
            return
        for px, py in self.points:
            if (px - x) * (px - x) + (py - y) * (py - y) <= reach * reach:
                found.append((px, py))
        for child in self.children or ():
            child.near(x, y, reach, found)


def prepare(seed):
    random = Random(seed)
    return [(random.uniform(-1, 1), random.uniform(-1, 1)) for _ in range(150)]


def run(state):
    root = Square(0.0, 0.0, 1.0)
    for point in state:
        root.insert(point)
    count = 0
    for x, y in state[::5]:
        found = []
        root.near(x, y, 0.1, found)
        count += len(found)
    return count
