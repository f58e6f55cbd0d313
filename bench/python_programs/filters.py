"""Median and exponential filters of sonar readings, with outliers thrown away."""

from collections import deque
from random import Random


class Median:
    def __init__(self, size):
        self.window = deque(maxlen=size)

    def add(self, value):
        self.window.append(value)
        ordered = sorted(self.window)
        middle = len(ordered) // 2
        if len(ordered) % 2:
            return ordered[middle]
        return (ordered[middle - 1] + ordered[middle]) / 2


class Sonar:
    def __init__(self):
        self.median = Median(7)
        self.smooth = None
        self.thrown = 0

    def reading(self, value):
        middle = self.median.add(value)
        if abs(value - middle) > 1.5:
            self.thrown += 1
            return self.smooth
        self.smooth = middle if self.smooth is None else 0.7 * self.smooth + 0.3 * middle
        return self.smooth


def prepare(seed):
    random = Random(seed)
    return [4 + random.gauss(0, 0.1) + (random.random() < 0.1) * 5 for _ in range(5000)]


def run(state):
    sonar = Sonar()
    kept = [sonar.reading(value) for value in state]
    return sonar.thrown, kept[-1]
