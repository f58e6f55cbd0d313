"""A Kalman filter of position and velocity in the plane, its matrices as lists of lists."""

from random import Random


def multiply(a, b):
    columns = list(zip(*b, strict=True))
    return [[sum(x * y for x, y in zip(row, column, strict=True)) for column in columns] for row in a]


def transpose(a):
    return [list(row) for row in zip(*a, strict=True)]


def add(a, b, sign=1.0):
    return [[x + sign * y for x, y in zip(p, q, strict=True)] for p, q in zip(a, b, strict=True)]


def inverse2(m):
    (a, b), (c, d) = m
    determinant = a * d - b * c
    return [[d / determinant, -b / determinant], [-c / determinant, a / determinant]]


def identity(n):
    return [[1.0 if row == column else 0.0 for column in range(n)] for row in range(n)]


def prepare(seed):
    random = Random(seed)
    return [(0.1 * k + random.gauss(0, 1), 0.2 * k + random.gauss(0, 1)) for k in range(60)]


def run(state):
    dt = 0.1
    f = [[1, 0, dt, 0], [0, 1, 0, dt], [0, 0, 1, 0], [0, 0, 0, 1]]
    h = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]
    q = [[0.01 * value for value in row] for row in identity(4)]
    r = identity(2)
    x, p = [[0.0], [0.0], [0.0], [0.0]], identity(4)
    for east, north in state:
        x = multiply(f, x)
        p = add(multiply(multiply(f, p), transpose(f)), q)
        innovation = add([[east], [north]], multiply(h, x), -1.0)
        s = add(multiply(multiply(h, p), transpose(h)), r)
        gain = multiply(multiply(p, transpose(h)), inverse2(s))
        x = add(x, multiply(gain, innovation))
        p = multiply(add(identity(4), multiply(gain, h), -1.0), p)
    return x
