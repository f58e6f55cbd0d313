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
