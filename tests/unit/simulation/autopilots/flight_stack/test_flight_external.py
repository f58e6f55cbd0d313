"""External control: an autopilot of a test gives one command for each motor, and the flight stack rests."""

from math import degrees

import pytest

from rigs.hovering_autopilot import HoveringAutopilot, motor_commands, off_centre
from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, quaternion_to_euler
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.world.body_specs import FRAMES, Multirotor, WheeledRover, frame_rotors

HERE = LocalFrame(-35.363261, 149.165230, 584.0)


def _body(spec):
    kernel = VirtualKernel()
    _, (flight,) = make_world(kernel.now, [spec], seed=3, frame=HERE)
    return kernel, flight


def _run(kernel, duration):
    end = kernel.now() + duration
    kernel.call_at(end, lambda: None)  # time stands still where nothing happens
    kernel.run(end)


@pytest.mark.parametrize("frame", FRAMES)
def test_a_frame_hovers_on_commands_to_its_motors(frame):
    kernel, flight = _body(Multirotor(rotors=frame_rotors(frame, 0.3), sensors="rtk"))
    autopilot = HoveringAutopilot(kernel, flight, height=6.0)
    heights = []
    kernel.every(S, lambda: heights.append(flight.truth().position[2]))
    _run(kernel, 30 * S)
    autopilot.close()
    assert heights[20:] == pytest.approx([6.12] * len(heights[20:]), abs=0.5)
    assert off_centre(flight) < 0.5


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_motors_turn_the_body_about_the_wanted_axis_alone(frame, axis):
    spec = Multirotor(rotors=frame_rotors(frame, 0.3), sensors="perfect")
    kernel, flight = _body(spec)
    autopilot = HoveringAutopilot(kernel, flight, height=20.0)
    _run(kernel, 8 * S)
    autopilot.close()
    before = flight.truth().rates
    turn = [0.0, 0.0, 0.0]
    turn[axis] = 2.0 if axis == 2 else 6.0
    flight.drive_motors(motor_commands(spec, spec.weight, turn))
    _run(kernel, 100 * MS)
    now = flight.truth().rates
    forward, left, up = (after - early for after, early in zip(now, before, strict=True))
    gained = [forward, -left, -up]  # forward, right, down
    assert gained[axis] > 0.03 * turn[axis]  # over 0.1 s, in which the rotors follow with their lag
    del gained[axis]
    assert gained == pytest.approx([0.0, 0.0], abs=0.05)


def test_estimator_and_loops_rest_while_samples_go_on():
    kernel, flight = _body(Multirotor())
    flight.drive_motors([0.0] * 4)
    _run(kernel, 2 * MS)
    first = flight.estimate()
    _run(kernel, 2 * S)
    second = flight.estimate()
    assert second.gyro != first.gyro
    assert second.gps.count > first.gps.count
    assert (second.quaternion, second.sigmas) == (first.quaternion, first.sigmas)


def test_a_rover_steers_to_the_right_and_drives():
    kernel, flight = _body(WheeledRover(sensors="perfect"))
    flight.drive_motors([0.5, 0.3])
    _run(kernel, 2 * S)
    _, _, yaw = quaternion_to_euler(flight.truth().attitude)
    assert flight.truth().distance > 1.0
    assert degrees(yaw) < 80.0  # it faced the north, 90 degrees from the east


@pytest.mark.parametrize(
    "commands", [[0.5] * 3, [0.5] * 5, [0.5, 0.5, 0.5, 1.1], [-0.1] * 4, [float("nan")] * 4]
)
def test_commands_that_do_not_fit_the_motors_are_refused(commands):
    _, flight = _body(Multirotor())
    with pytest.raises(UsageError, match="give 4, each from 0 to 1"):
        flight.drive_motors(commands)
