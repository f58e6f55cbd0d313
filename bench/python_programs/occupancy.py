"""An occupancy grid updated along rays with Bresenham's lines."""

from math import cos, exp, pi, sin
from random import Random

FREE, TAKEN, LIMIT = -0.4, 0.9, 5.0


def line(x0, y0, x1, y1):
    dx, dy = abs(x1 - x0), -abs(y1 - y0)
    step_x, step_y = 1 if x0 < x1 else -1, 1 if y0 < y1 else -1
    error = dx + dy
    while True:
        yield x0, y0
        if x0 == x1 and y0 == y1:
            return
        twice = 2 * error
        if twice >= dy:
            error += dy
            x0 += step_x
        if twice <= dx:
            error += dx
            y0 += step_y


def update(grid, here, ranges):
    for number, distance in enumerate(ranges):
        angle = 2 * pi * number / len(ranges)
        end = int(here[0] + distance * cos(angle)), int(here[1] + distance * sin(angle))
        for x, y in line(*here, *end):
            if 0 <= x < len(grid) and 0 <= y < len(grid):
                change = TAKEN if (x, y) == end else FREE
                grid[x][y] = max(-LIMIT, min(LIMIT, grid[x][y] + change))


def prepare(seed):
    random = Random(seed)
    return [[random.uniform(8, 28) for _ in range(120)] for _ in range(4)]


def run(state):
    grid = [[0.0] * 64 for _ in range(64)]
    for number, ranges in enumerate(state):
        update(grid, (30 + number, 32), ranges)
    return sum(1 for row in grid for value in row if 1 - 1 / (1 + exp(value)) > 0.6)
