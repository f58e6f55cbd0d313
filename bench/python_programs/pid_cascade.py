"""Position, velocity and attitude loops of one axis after the other, against a simple plant."""

from random import Random


class Pid:
    def __init__(self, p, i, d, limit):
        self.p, self.i, self.d, self.limit = p, i, d, limit
        self.total = 0.0
        self.before = 0.0

    def update(self, error, dt):
        self.total = max(-self.limit, min(self.limit, self.total + error * dt))
        rate = (error - self.before) / dt
        self.before = error
        wanted = self.p * error + self.i * self.total + self.d * rate
        return max(-self.limit, min(self.limit, wanted))


class Axis:
    def __init__(self):
        self.position = Pid(1.2, 0.0, 0.1, 5.0)
        self.velocity = Pid(2.0, 0.4, 0.05, 8.0)
        self.x, self.v = 0.0, 0.0

    def step(self, target, push, dt):
        wanted = self.position.update(target - self.x, dt)
        force = self.velocity.update(wanted - self.v, dt)
        self.v += (force + push - 0.3 * self.v) * dt
        self.x += self.v * dt


def prepare(seed):
    random = Random(seed)
    targets = [[random.uniform(-10, 10) for _ in range(3)] for _ in range(30)]
    return targets, [random.gauss(0, 0.5) for _ in range(50)]


def run(state):
    targets, gusts = state
    axes = [Axis() for _ in range(3)]
    for target in targets:
        for gust in gusts:
            for axis, wanted in zip(axes, target, strict=True):
                axis.step(wanted, gust, 0.02)
    return [axis.x for axis in axes]
