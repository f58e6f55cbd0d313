"""Programs that are timed as whole units; each is a module of its own after its line ``# === NAME ===``.

They are data: no code imports this file. They are written as components are, in one file so that one look
shows which constructs they cover. ``run(state)`` is timed, ``prepare(seed)`` is not.
"""

# === bits ===
"""Bytes packed and unpacked by hand: integers, shifts, bytearrays, loops with while."""

from random import Random


def table(polynomial):
    entries = []
    for value in range(64):
        for _ in range(8):
            value = (value >> 1) ^ polynomial if value & 1 else value >> 1  # noqa: PLW2901
        entries.append(value)
    return entries


def pack(values, widths):
    out, held, bits = bytearray(), 0, 0
    for value, width in zip(values, widths, strict=True):
        held |= (value & ((1 << width) - 1)) << bits
        bits += width
        while bits >= 8:
            out.append(held & 0xFF)
            held >>= 8
            bits -= 8
    if bits:
        out.append(held)
    return out


def unpack(data, widths):
    found, held, bits, place = [], 0, 0, 0
    for width in widths:
        while bits < width:
            held |= data[place] << bits
            place += 1
            bits += 8
        found.append(held & ((1 << width) - 1))
        held >>= width
        bits -= width
    return found


def prepare(seed):
    random = Random(seed)
    widths = [random.randrange(1, 15) for _ in range(400)]
    return [random.randrange(1 << width) for width in widths], widths


def run(state):
    values, widths = state
    data = pack(values, widths)
    crc = 0
    entries = table(0xA001)
    for byte in data:
        crc = (crc >> 6) ^ entries[(crc ^ byte) & 0x3F]
    return unpack(data, widths) == values, crc


# === elimination ===
"""Linear equations by Gauss's elimination: lists of lists by index."""

from random import Random


def solve(matrix, right):
    n = len(matrix)
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for column in range(n):
        pivot = max(range(column, n), key=lambda row: abs(rows[row][column]))
        rows[column], rows[pivot] = rows[pivot], rows[column]
        for row in range(column + 1, n):
            share = rows[row][column] / rows[column][column]
            for k in range(column, n + 1):
                rows[row][k] -= share * rows[column][k]
    found = [0.0] * n
    for row in range(n - 1, -1, -1):
        rest = rows[row][n] - sum(rows[row][k] * found[k] for k in range(row + 1, n))
        found[row] = rest / rows[row][row]
    return found


def prepare(seed):
    random = Random(seed)
    return [
        ([[random.uniform(-1, 1) for _ in range(8)] for _ in range(8)], [random.random() for _ in range(8)])
        for _ in range(12)
    ]


def run(state):
    return [solve(matrix, right)[0] for matrix, right in state]


# === geodesy ===
"""Points on the earth: named tuples, trigonometry, small functions."""

from math import asin, atan2, cos, degrees, pi, radians, sin, sqrt
from random import Random
from typing import NamedTuple

RADIUS = 6371000.0


class Point(NamedTuple):
    latitude: float
    longitude: float
    height: float = 0.0

    def raised(self, by):
        return Point(self.latitude, self.longitude, self.height + by)


def distance(one, other):
    north = radians(other.latitude - one.latitude)
    east = radians(other.longitude - one.longitude)
    half = (
        sin(north / 2) ** 2 + cos(radians(one.latitude)) * cos(radians(other.latitude)) * sin(east / 2) ** 2
    )
    return 2 * RADIUS * asin(sqrt(half))


def bearing(one, other):
    east = radians(other.longitude - one.longitude)
    y = sin(east) * cos(radians(other.latitude))
    x = cos(radians(one.latitude)) * sin(radians(other.latitude))
    x -= sin(radians(one.latitude)) * cos(radians(other.latitude)) * cos(east)
    return degrees(atan2(y, x)) % 360.0


def onward(start, course, length):
    share = length / RADIUS
    latitude = start.latitude + degrees(share * cos(radians(course)))
    longitude = start.longitude + degrees(share * sin(radians(course)) / cos(radians(latitude)))
    return Point(latitude, (longitude + 180.0) % 360.0 - 180.0, start.height)


def prepare(seed):
    random = Random(seed)
    return [
        Point(random.uniform(40, 44), random.uniform(-5, 0), random.uniform(0, 2 * pi)) for _ in range(250)
    ]


def run(state):
    here = state[0]
    total = 0.0
    for point in state[1:]:
        length = distance(here, point)
        here = onward(here, bearing(here, point), min(length, 500.0)).raised(1.0)
        total += length
    return total


# === machine ===
"""A vehicle's states and what moves it between them: small methods, strings, dicts."""

from random import Random


class Machine:
    def __init__(self):
        self.state = "idle"
        self.height = 0.0
        self.battery = 1.0
        self.log = []
        self.doing = {
            "idle": self.idle,
            "climb": self.climb,
            "cruise": self.cruise,
            "sink": self.sink,
        }

    def go(self, state, why):
        self.log.append((self.state, state, why))
        self.state = state

    def idle(self, ordered):
        if ordered and self.battery > 0.3:
            self.go("climb", "ordered")
        self.battery = min(1.0, self.battery + 0.01)

    def climb(self, ordered):
        self.height += 0.5
        self.battery -= 0.004
        if self.height >= 5.0:
            self.go("cruise", "high enough")

    def cruise(self, ordered):
        self.battery -= 0.002
        if self.battery < 0.25:
            self.go("sink", "battery")
        elif not ordered:
            self.go("sink", "done")

    def sink(self, ordered):
        self.height = max(0.0, self.height - 0.4)
        if self.height == 0.0:
            self.go("idle", "landed")

    def step(self, ordered):
        self.doing[self.state](ordered)


def prepare(seed):
    random = Random(seed)
    return [random.random() < 0.9 for _ in range(2500)]


def run(state):
    machine = Machine()
    for ordered in state:
        machine.step(ordered)
    return len(machine.log), machine.state


# === means ===
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


# === orders ===
"""Orders and stock: dataclasses, dicts, exceptions, sorting by a key, text."""

from dataclasses import dataclass, field
from random import Random


class OutOfStockError(Exception):
    pass


@dataclass
class Order:
    number: int
    good: str
    amount: int
    urgent: bool = False
    history: list = field(default_factory=list)

    def note(self, state):
        self.history.append(f"{self.number:03d} {state}")


@dataclass(frozen=True)
class Place:
    x: float
    y: float

    def to(self, other):
        return abs(self.x - other.x) + abs(self.y - other.y)


class Store:
    def __init__(self, place, stock):
        self.place = place
        self.stock = dict(stock)

    def take(self, good, amount):
        left = self.stock.get(good, 0) - amount
        if left < 0:
            raise OutOfStockError(good)
        self.stock[good] = left


def serve(stores, order, where):
    for store in sorted(stores, key=lambda store: store.place.to(where)):
        try:
            store.take(order.good, order.amount)
        except OutOfStockError:
            order.note("not here")
            continue
        order.note("taken")
        return store
    order.note("refused")
    return None


def prepare(seed):
    random = Random(seed)
    goods = ["blood", "vaccine", "antidote", "kit"]
    stores = [
        (random.random(), random.random(), {good: random.randrange(40) for good in goods}) for _ in range(4)
    ]
    wanted = [(random.choice(goods), random.randrange(1, 5), random.random() < 0.2) for _ in range(120)]
    return stores, wanted


def run(state):
    stores = [Store(Place(x, y), stock) for x, y, stock in state[0]]
    orders = [Order(number, *wanted) for number, wanted in enumerate(state[1])]
    orders.sort(key=lambda order: (not order.urgent, order.number))
    served = [serve(stores, order, Place(order.number % 7 / 7, 0.5)) for order in orders]
    text = ",".join(line for order in orders for line in order.history)
    return sum(store is not None for store in served), len(text)


# === particles ===
"""A particle filter: objects with attributes, weights, resampling."""

from math import exp, hypot
from random import Random


class Particle:
    def __init__(self, x, y, weight=1.0):
        self.x = x
        self.y = y
        self.weight = weight

    def move(self, dx, dy):
        self.x += dx
        self.y += dy

    def weigh(self, marks, seen):
        error = 0.0
        for (east, north), distance in zip(marks, seen, strict=True):
            error += (hypot(east - self.x, north - self.y) - distance) ** 2
        self.weight = exp(-0.5 * error)

    def copy(self):
        return Particle(self.x, self.y)


def resample(particles, start):
    total = sum(particle.weight for particle in particles) or 1.0
    step = total / len(particles)
    chosen, index, passed = [], 0, particles[0].weight
    for number in range(len(particles)):
        wanted = (number + start) * step
        while passed < wanted and index < len(particles) - 1:
            index += 1
            passed += particles[index].weight
        chosen.append(particles[index].copy())
    return chosen


def prepare(seed):
    random = Random(seed)
    marks = [(random.uniform(-5, 5), random.uniform(-5, 5)) for _ in range(5)]
    spots = [(random.gauss(0, 1), random.gauss(0, 1)) for _ in range(100)]
    return marks, spots, [(random.gauss(0, 0.1), random.gauss(0, 0.1), random.random()) for _ in range(10)]


def run(state):
    marks, spots, moves = state
    particles = [Particle(x, y) for x, y in spots]
    here = [0.0, 0.0]
    for dx, dy, start in moves:
        here[0] += dx
        here[1] += dy
        seen = [hypot(east - here[0], north - here[1]) for east, north in marks]
        for particle in particles:
            particle.move(dx, dy)
            particle.weigh(marks, seen)
        particles = resample(particles, start)
    return particles[0].x


# === planets ===
"""Bodies that attract each other: floats in lists and nested loops."""

from math import sqrt
from random import Random


def advance(bodies, dt, steps):
    for _ in range(steps):
        for index, one in enumerate(bodies):
            for other in bodies[index + 1 :]:
                dx = one[0] - other[0]
                dy = one[1] - other[1]
                square = dx * dx + dy * dy + 0.01
                pull = dt / (square * sqrt(square))
                one[2] -= dx * other[4] * pull
                one[3] -= dy * other[4] * pull
                other[2] += dx * one[4] * pull
                other[3] += dy * one[4] * pull
        for body in bodies:
            body[0] += dt * body[2]
            body[1] += dt * body[3]


def prepare(seed):
    random = Random(seed)
    return [[random.uniform(-1, 1) for _ in range(4)] + [1.0] for _ in range(5)]


def run(state):
    bodies = [list(body) for body in state]
    advance(bodies, 0.001, 60)
    return bodies[0][0]


# === quadtree ===
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


# === shortest_ways ===
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


# === smoothing ===
"""Running filters over samples: deques, slices, generators, any and all."""

from collections import deque
from random import Random


def running_mean(values, size):
    window, total = deque(), 0.0
    for value in values:
        window.append(value)
        total += value
        if len(window) > size:
            total -= window.popleft()
        yield total / len(window)


def pieces(values, size):
    for start in range(0, len(values), size):
        yield values[start : start + size]


def spread(piece):
    middle = sum(piece) / len(piece)
    return (sum((value - middle) ** 2 for value in piece) / len(piece)) ** 0.5


def steady(piece, limit):
    return all(abs(one - other) < limit for one, other in zip(piece, piece[1:], strict=False))  # noqa: RUF007


def prepare(seed):
    random = Random(seed)
    return [random.gauss(0, 1) for _ in range(900)]


def run(state):
    smooth = list(running_mean(state, 8))
    spreads = [spread(piece) for piece in pieces(smooth, 16)]
    count = sum(1 for piece in pieces(smooth, 5) if steady(piece, 0.5))
    worst = max(spreads)
    return sorted(spreads)[len(spreads) // 2], count, worst, any(value > 2.5 for value in smooth)


# === spline ===
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


# === tokens ===
"""A calculator: characters become tokens, tokens a value, by functions that call each other."""

from random import Random


def tokens_of(text):
    position = 0
    while position < len(text):
        character = text[position]
        if character == " ":
            position += 1
        elif character.isdigit():
            end = position
            while end < len(text) and (text[end].isdigit() or text[end] == "."):
                end += 1
            yield "number", float(text[position:end])
            position = end
        else:
            yield "sign", character
            position += 1


class Calculator:
    def __init__(self, text):
        self.tokens = list(tokens_of(text))
        self.at = 0

    def peek(self):
        return self.tokens[self.at][1] if self.at < len(self.tokens) else None

    def take(self):
        token = self.tokens[self.at]
        self.at += 1
        return token

    def total(self):
        value = self.product()
        while self.peek() in ("+", "-"):
            sign = self.take()[1]
            other = self.product()
            value = value + other if sign == "+" else value - other
        return value

    def product(self):
        value = self.atom()
        while self.peek() == "*":
            self.take()
            value *= self.atom()
        return value

    def atom(self):
        kind, value = self.take()
        if kind == "number":
            return value
        if value != "(":
            raise ValueError(value)
        inside = self.total()
        self.take()
        return inside


def prepare(seed):
    random = Random(seed)
    lines = []
    for _ in range(40):
        parts = [f"{random.random() * 9:.1f} {random.choice('+-*')}" for _ in range(5)]
        lines.append(f"({' '.join(parts)} 2) * 3 + {random.randrange(90)}")
    return lines


def run(state):
    return sum(Calculator(line).total() for line in state)


# === words ===
"""Lines of settings read into a tree: splitting, stripping, nested dicts, formatting."""

from random import Random


def parse(lines):
    root = {}
    stack = [(-1, root)]
    for number, line in enumerate(lines, 1):
        bare = line.strip()
        if not bare or bare.startswith("#"):
            continue
        depth = len(line) - len(line.lstrip(" "))
        while stack[-1][0] >= depth:
            stack.pop()
        key, colon, value = bare.partition(":")
        if not colon:
            raise ValueError(f"line {number}: {bare}")
        value = value.strip()
        if value:
            stack[-1][1][key] = convert(value)
        else:
            inner = stack[-1][1].setdefault(key, {})
            stack.append((depth, inner))
    return root


def convert(text):
    if text in ("true", "false"):
        return text == "true"
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        return text


def flat(tree, path=""):
    for key, value in tree.items():
        here = f"{path}.{key}" if path else key
        if isinstance(value, dict):
            yield from flat(value, here)
        else:
            yield f"{here}={value}"


def prepare(seed):
    random = Random(seed)
    lines = []
    for group in range(12):
        lines.append(f"group_{group}:")
        for item in range(4):
            lines.append(f"  item_{item}:")
            lines.append(f"    limit: {random.random():.3f}")
            lines.append(f"    count: {random.randrange(100)}")
            lines.append(f"    kind: {random.choice(['true', 'slow', '7'])}")
            lines.append("    # a remark")
    return lines


def run(state):
    return len(list(flat(parse(state))))
