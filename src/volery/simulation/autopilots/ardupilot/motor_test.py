"""ArduPilot's motor test: one motor after the other turns on the ground, each for some seconds.

The vehicle is armed meanwhile, and failsafes of station and transmitter do not act. A copter's motors are
tested in ArduPilot's order, clockwise from the front; a rover's throttle really drives it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from volery.base.time import Ns, from_seconds
from volery.simulation.autopilots.ardupilot.failsafes import conditions_of
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept
from volery.simulation.autopilots.ardupilot.modes import arm, disarm
from volery.simulation.autopilots.ardupilot.pilot_input import switches_of
from volery.simulation.autopilots.autopilot_parameters import single
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, FAILED, Command
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import OFF, AutopilotVehicle
from volery.simulation.world.body_specs import FRAMES, Multirotor
from volery.trace.events import CRITICAL, INFO

MOTOR_TEST = 209
PERCENT, PULSE, PILOT = 0, 1, 2
"""MOTOR_TEST_THROTTLE_TYPE."""
LONGEST, LONGEST_OF_ROVER = 600.0, 30.0
"""Longest time of one motor [s]."""
SHORTEST_PULSE, LONGEST_PULSE, LONGEST_PULSE_OF_ROVER = 800.0, 2200.0, 2200.0
"""Pulse widths [us] between which a motor turns."""
PLUS = 0
"""FRAME_TYPE."""
ORDER, ORDER_OF_PLUS = (0, 3, 1, 2), (2, 0, 3, 1)
"""Motors in the order of the test, from 0."""
THROTTLE, STEERING, RIGHT_THROTTLE = 1, 2, 4
"""Outputs of a rover."""


@dataclass
class MotorTestState:
    """Test of motors on the ground."""

    running: bool = False
    motor: int = 0
    """Number of the motor in the order of the test, from 1."""
    motors_left: int = 1
    """Motors that are tested yet, with this one."""
    kind: int = 0
    """MOTOR_TEST_THROTTLE_TYPE."""
    value: float = 0.0
    since: Ns = NEVER
    period: Ns = 0
    """Time for which each motor turns."""


test_of = Kept(MotorTestState)


def _refused(vehicle: AutopilotVehicle, text: str) -> int:
    vehicle.send_text(CRITICAL, f"Motor Test: {text}")
    return FAILED


def on_copter_test(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_MOTOR_TEST of a copter.

    param1 is the first motor in the order of the test, param2 the kind of param3, param4 the seconds of each
    motor and param5 the number of motors.
    """
    test = test_of(vehicle)
    if not test.running:
        if not vehicle.landed:
            return _refused(vehicle, "vehicle not landed")
        if switches_of(vehicle).emergency_stop:
            return _refused(vehicle, "Motor Emergency Stopped")
        if not vehicle.armed:
            vehicle.arm()
    _start(vehicle, command, LONGEST)
    test.motors_left = max(1, round(command.fifth))
    return ACCEPTED


def on_rover_test(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_MOTOR_TEST of a rover: param1 is the output, the others are as for a copter."""
    test, kind, value = test_of(vehicle), round(command.param2), command.param3
    if not test.running:
        if not 0 <= command.param1 <= RIGHT_THROTTLE:
            return _refused(vehicle, f"invalid motor ({round(command.param1)})")
        if not PERCENT <= kind <= PILOT:
            return _refused(vehicle, f"invalid throttle type: {kind}")
        if kind == PULSE and value > LONGEST_PULSE_OF_ROVER:
            return _refused(vehicle, f"pwm ({round(value)}) too high")
        if kind == PERCENT and value > 100.0:
            return _refused(vehicle, f"percentage ({round(value)}) too high")
        if arm(vehicle) != ACCEPTED:
            return FAILED
    _start(vehicle, command, LONGEST_OF_ROVER)
    return ACCEPTED


def _start(vehicle: AutopilotVehicle, command: Command, longest: float) -> None:
    test = test_of(vehicle)
    seconds = command.param4 if isfinite(command.param4) else 0.0
    test.running, test.since = True, vehicle.kernel.now()
    conditions_of(vehicle).suspended = True
    test.period = from_seconds(min(longest, max(0.0, seconds)))
    test.motor, test.kind, test.value = round(command.param1), round(command.param2), command.param3


def _pulse(vehicle: AutopilotVehicle, test: MotorTestState) -> float | None:
    """Return the pulse width of the motor [us], or ``None`` if the test cannot go on."""
    if test.kind == PULSE:
        pulse = float(int(test.value))
    elif test.kind == PERCENT and test.value <= 100.0:
        low, high = vehicle.parameters["MOT_PWM_MIN"], vehicle.parameters["MOT_PWM_MAX"]
        pulse = float(int(low + single((high - low) * test.value) / 100.0))  # 90.1 % is 1901 us
    elif test.kind == PILOT:
        pulse = float(vehicle.rc[vehicle.tuning.sticks.throttle])
    else:
        return None
    return pulse if SHORTEST_PULSE <= pulse <= LONGEST_PULSE else None


def _order(vehicle: AutopilotVehicle) -> Sequence[int]:
    """Return the motors in the order of the test, from 0."""
    spec = vehicle.flight.spec
    if isinstance(spec, Multirotor) and spec.frame:
        angles = [angle % 360.0 for angle, _ in FRAMES[spec.frame]]
        return sorted(range(len(angles)), key=angles.__getitem__)
    return ORDER_OF_PLUS if round(vehicle.parameters["FRAME_TYPE"]) == PLUS else ORDER


def _end(vehicle: AutopilotVehicle) -> None:
    test_of(vehicle).running = conditions_of(vehicle).suspended = False


def turn_tested_motor(vehicle: AutopilotVehicle) -> None:
    """Turn the motor whose test it is, at each tick."""
    test, now = test_of(vehicle), vehicle.kernel.now()
    if not test.running:
        return
    over = now - test.since >= test.period
    if over and test.motors_left > 1 and 2 * (now - test.since) < 3 * test.period:
        vehicle.drive(OFF)  # a pause of half the time
        return
    if over and test.motors_left > 1:
        test.motor += 1
        test.motors_left -= 1
        test.since, over = now, False
    pulse = None if over or not vehicle.armed else _pulse(vehicle, test)
    if pulse is None:
        _end(vehicle)
        vehicle.send_text(INFO, "finished motor test")
        vehicle.disarm()
        return
    order = _order(vehicle)
    if 1 <= test.motor <= len(order):
        share = min(1.0, max(0.0, pulse / 1000.0 - 1.0))
        vehicle.drive(Setpoint(Control.MOTOR, motor=order[test.motor - 1], throttle=share))
    else:
        vehicle.drive(OFF)


def drive_tested_output(vehicle: AutopilotVehicle) -> None:
    """Drive the output whose test it is, at each tick."""
    test = test_of(vehicle)
    if not test.running:
        return
    share = _share_of_rover(vehicle, test)
    if share is None or not vehicle.armed or vehicle.kernel.now() - test.since >= test.period:
        _end(vehicle)
        disarm(vehicle, force=True)
    elif test.motor == STEERING:
        vehicle.drive(Setpoint(Control.STEER, steering=share))
    else:
        vehicle.drive(Setpoint(Control.STEER, throttle=share))


def _share_of_rover(vehicle: AutopilotVehicle, test: MotorTestState) -> float | None:
    """Return throttle or steering -1..1, or ``None`` if the rover has no such output."""
    if test.motor not in (THROTTLE, STEERING):
        return None
    if test.kind == PULSE:
        share = (int(test.value) - 1500.0) / 500.0
    elif test.kind == PERCENT:
        share = test.value / 100.0
    else:
        sticks, travels = vehicle.tuning.sticks, vehicle.tuning.sticks.travels
        steers = test.motor == STEERING
        channel, travel = (sticks.roll, travels[0]) if steers else (sticks.throttle, travels[2])
        share = travel.deflection(vehicle.rc[channel])
    return min(1.0, max(-1.0, share))


COPTER = Feature(
    parameters={
        "MOT_PWM_MAX": ("µs", "pulse width of a motor test at 100 %"),
        "MOT_PWM_MIN": ("µs", "pulse width of a motor test at 0 %"),
    },
    commands={MOTOR_TEST: on_copter_test},
    on_tick=turn_tested_motor,
)
ROVER = Feature(commands={MOTOR_TEST: on_rover_test}, on_tick=drive_tested_output)
