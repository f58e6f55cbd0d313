"""One vehicle in a world, with a clock that the test sets."""

import json
from pathlib import Path

import pytest

from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint, make_world
from volery.simulation.world.body_specs import Multirotor, WheeledRover

HERE = LocalFrame(-35.363261, 149.165230, 584.0)
READ_PERIOD = 50 * MS


class Flown:
    """One vehicle that a test drives and observes."""

    def __init__(self, spec, seed=1, wind=None):
        self.now = 0
        self.world, (self.flight,) = make_world(lambda: self.now, [spec], seed=seed, frame=HERE, wind=wind)

    def seconds(self):
        return self.now / S

    def wait(self, seconds, until=lambda estimate, truth: False):
        """Read 20 times a second and return (seconds since the call, estimate, truth) of each read."""
        start = self.now
        seen = []
        while self.now < start + round(seconds * S):
            self.now += READ_PERIOD
            estimate, truth = self.flight.estimate(), self.flight.truth()
            seen.append(((self.now - start) / S, estimate, truth))
            if until(estimate, truth):
                break
        return seen

    def drive(self, control, **targets):
        self.flight.drive(Setpoint(control, **targets))

    def ready(self, settle=20.0):
        """Set the origin, and let the motors idle."""
        self.wait(1)
        self.flight.set_origin()
        self.wait(settle)
        self.drive(Control.IDLE)
        self.wait(2)
        return self

    def hover(self, height=10.0, **limits):
        """Hover at a height above the origin."""
        self.ready()
        self.drive(Control.POSITION, position=(0.0, 0.0, -height), **limits)
        self.wait(20)
        return self


@pytest.fixture
def drone():
    return lambda sensors="consumer", seed=1, wind=None, **spec: Flown(
        Multirotor(sensors=sensors, **spec), seed, wind
    )


@pytest.fixture
def rover():
    return lambda sensors="consumer", seed=1, **spec: Flown(WheeledRover(sensors=sensors, **spec), seed)


@pytest.fixture(scope="session")
def recorded():
    """Figures read from recordings of ArduPilot 4.5.6."""
    return json.loads((Path(__file__).parents[4] / "golden" / "ardupilot-flight.json").read_text())
