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
