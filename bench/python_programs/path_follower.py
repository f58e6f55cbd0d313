"""Pure pursuit: the next point ahead on a route, and the turn towards it."""

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin
from random import Random


@dataclass
class Pose:
    x: float
    y: float
    heading: float


@dataclass(frozen=True)
class Command:
    speed: float
    turn: float


class Follower:
    def __init__(self, route, ahead):
        self.route = route
        self.ahead = ahead
        self.index = 0

    def target(self, pose):
        while self.index < len(self.route) - 1:
            x, y = self.route[self.index]
            if hypot(x - pose.x, y - pose.y) > self.ahead:
                break
            self.index += 1
        return self.route[self.index]

    def command(self, pose):
        x, y = self.target(pose)
        error = (atan2(y - pose.y, x - pose.x) - pose.heading + pi) % (2 * pi) - pi
        left = hypot(self.route[-1][0] - pose.x, self.route[-1][1] - pose.y)
        speed = min(1.5, left) * max(0.1, cos(error)) if left > 0.2 else 0.0
        return Command(speed, max(-1.0, min(1.0, 2.0 * error)))


def advance(pose, command, dt):
    heading = pose.heading + command.turn * dt
    return Pose(
        pose.x + command.speed * cos(heading) * dt, pose.y + command.speed * sin(heading) * dt, heading
    )


def prepare(seed):
    random = Random(seed)
    x = y = 0.0
    route = []
    for _ in range(40):
        x += random.uniform(0.5, 3)
        y += random.uniform(-2, 2)
        route.append((x, y))
    return route


def run(state):
    follower = Follower(state, 1.0)
    pose = Pose(0.0, 0.0, 0.0)
    for _ in range(2000):
        command = follower.command(pose)
        if not command.speed:
            break
        pose = advance(pose, command, 0.1)
    return pose
