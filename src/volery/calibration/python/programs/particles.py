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
