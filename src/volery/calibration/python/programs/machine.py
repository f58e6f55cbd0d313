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
