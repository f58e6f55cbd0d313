"""A clock that the test sets, and a battery of constant voltage and unlimited capacity."""

import pytest

from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.simulation.world.body_specs import BatteryPack

IDEAL = BatteryPack(capacity_ah=1e12, resistance_ohm=1e-18)


class Clock:
    def __init__(self):
        self.now = 0

    def __call__(self):
        return self.now

    def wait(self, seconds):
        self.now += round(seconds * S)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def frame():
    return LocalFrame(47.3977, 8.5456, 488.0)


@pytest.fixture
def ideal_battery():
    return IDEAL
