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
