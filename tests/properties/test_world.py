"""The world is a function of (grid step, inputs): looking, at whatever times, changes nothing."""

from math import isfinite

from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.frames import LocalFrame
from volery.base.time import MS
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint, make_world
from volery.simulation.world.body_specs import Multirotor, WheeledRover
from volery.simulation.world.environment_models import Wind

HERE = LocalFrame(47.4, 8.5, 400.0)
LENGTH = 4000  # milliseconds
moments = st.integers(0, LENGTH - 1)
looks = st.lists(st.tuples(moments, st.integers(0, 1), st.booleans()), max_size=40)
goals = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-20, 0))
drives = st.lists(
    st.tuples(
        moments,
        st.integers(0, 1),
        st.sampled_from([Control.IDLE, Control.POSITION, Control.VELOCITY, Control.ATTITUDE, Control.DRIVE]),
        goals,
    ),
    max_size=12,
)


def flown(drives, looks):
    """Bytes of everything after a schedule of set-points, seen at the moments of *looks* besides the end."""
    now = 0
    specs = [Multirotor(), WheeledRover(at=(10.0, 0.0, 0.0))]
    world, flights = make_world(lambda: now, specs, seed=5, frame=HERE, wind=Wind(east=2.0, gust=0.5))
    schedule = [(moment, 0, body, (control, goal)) for moment, body, control, goal in drives]
    schedule += [(moment, 1, body, deep) for moment, body, deep in looks]
    for moment, kind, body, what in sorted(schedule, key=lambda entry: entry[:2]):
        now = moment * MS
        if kind == 0:
            control, goal = what
            flights[body].drive(Setpoint(control, position=goal, velocity=goal, throttle=0.3))
        elif what:
            flights[body].truth()
        else:
            flights[body].estimate()
    now = LENGTH * MS
    for flight in flights:
        flight.estimate()
    return world.arrays.rows.tobytes()


@settings(max_examples=30, deadline=None)
@given(drives, looks)
def test_extra_looks_change_not_a_byte(drives, looks):
    assert flown(drives, looks) == flown(drives, [])


@settings(max_examples=30, deadline=None)
@given(drives)
def test_no_set_point_makes_anything_that_is_not_a_number(drives):
    assert all(isfinite(value) for value in memoryview(flown(drives, [])).cast("d"))
