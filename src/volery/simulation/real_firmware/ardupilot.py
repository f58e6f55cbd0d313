"""ArduPilot's JSON interface: the firmware asks by a datagram of pulse widths, and is answered by a text.

Every question has a number. The firmware repeats a question that was not answered for about a second, and
takes each answer for one to the next question, so a question must be answered once only.
Source: libraries/SITL/examples/JSON of ArduPilot; behaviour as measured with 4.5, 4.6 and 4.8.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable, Mapping, Sequence
from math import radians
from typing import Any

from volery.base.elementary import tan
from volery.base.frames import Vector
from volery.base.time import US, Ns, S, to_seconds
from volery.simulation.autopilots.ardupilot.copter import MODES as COPTER_MODES
from volery.simulation.autopilots.ardupilot.rover import MODES as ROVER_MODES
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.real_firmware.exchange import ANSWER_LIMIT_S, pose_after
from volery.simulation.real_firmware.firmware_instance import Assignment, FirmwareInstance
from volery.simulation.real_firmware.firmware_process import FirmwareProcess, LoopbackPort
from volery.simulation.real_firmware.ground_link import UdpConnection
from volery.simulation.world.body_specs import FRAMES, BodySpec, Multirotor
from volery.simulation.world.state_layout import (
    M_ACCEL,
    M_GYRO,
    M_RANGE,
    S_AMPS,
    S_VOLTS,
    U_GPS_DRIFT,
    U_GPS_OFFSET,
)

JSON_PORT = LoopbackPort("udp", 9002, 10)
"""Where the firmware sends its questions."""
GROUND_PORT = LoopbackPort("udp", 5766, 10)
"""Where the firmware sends what it says on its first serial port.

Over TCP what it says would wait for acknowledgements, whose time is that of the wall clock.
"""
_TRANSMITTER_PORT = LoopbackPort("udp", 5501, 10)
LISTENS = (LoopbackPort("tcp", 5762, 10), LoopbackPort("tcp", 5763, 10), _TRANSMITTER_PORT)
"""What the firmware opens beside: its other serial ports, and the receiver of a transmitter."""
LOOP_RATE = "SCHED_LOOP_RATE"
_USUAL_LOOP_RATE_HZ = {"multirotor": 400.0, "rover": 50.0}
_KINDS = {"multirotor": (2, 13, 14), "rover": (10,)}
"""MAV_TYPE: quadrotor, hexarotor, octorotor; ground rover."""
_CRUISE_SPEED = 2.0
"""CRUISE_SPEED of ArduRover [m/s], for which a builder measures the throttle."""
_SAMPLES = 2.0
_DEFAULTS = "parameters.parm"
"""In the folder in which the firmware runs: a path with a comma would count as several files."""
_START_TIME = 1_700_000_000
"""UTC of the firmware's start [s]; without one it would be that of the wall clock."""
_COMPASS_OFFSET = 1e-4
"""Offset of the compasses that the firmware simulates, by axis [mgauss]: as good as none, for one that it
freezes takes it off again at each sample. Without any a compass counts as not calibrated."""
_MAGIC_16, _MAGIC_32 = 18_458, 29_569
_QUESTION = struct.Struct("<HHI16H")
_TRANSMITTER = struct.Struct("<16H")
LARGEST_QUESTION = 128
_ROUND_UP = 1.0 + 1e-8
"""Factor on times: the firmware cuts the difference of two to whole microseconds."""
_ANSWER = (
    '\n{"timestamp":%.12f,"imu":{"gyro":[%.9g, %.9g, %.9g],"accel_body":[%.9g, %.9g, %.9g]},'
    '"position":[%.12g, %.12g, %.12g],"velocity":[%.9g, %.9g, %.9g],'
    '"quaternion":[%.9g, %.9g, %.9g, %.9g],"battery":{"voltage":%.6g,"current":%.6g},'
    '"rng_1":%.6g,"no_time_sync":1}\n'
)

_THROTTLES = tuple(min(max(0.001 * pulse - 1.0, 0.0), 1.0) for pulse in range(65_536))
"""Command of a motor by the pulse width [us], 1000 to 2000."""

Commands = Callable[[Sequence[int]], Sequence[float]]
"""From pulse widths [us] of all channels to motor commands."""


def question_in(octets: bytes) -> tuple[int, Sequence[int]]:
    """Return the number of a question and the pulse widths of its first 16 channels [us].

    Raises:
        ValueError: It is no question; the text says what it is.
    """
    if len(octets) < _QUESTION.size:
        raise ValueError(f"packets of {len(octets)} octets, too few for a question")
    magic, _, number, *pulses = _QUESTION.unpack_from(octets)
    if magic not in (_MAGIC_16, _MAGIC_32):
        raise ValueError(f"packets of another kind ({magic})")
    return number, pulses


class Answers:
    """The answers to the questions of one firmware.

    Args:
        home: North, east, down of the firmware's home about the world's origin [m].
        period: Time between two answers.
    """

    def __init__(self, home: Vector, period: Ns) -> None:
        self._home, self._period = home, period
        self._drifted = [0.0, 0.0]  # north, east [m] that the reported position has drifted

    def answer(self, time: Ns, row: Sequence[float], ahead: float) -> bytes:
        """Return the next answer.

        Args:
            time: Clock of the firmware from now on.
            row: State row of the body.
            ahead: Time since the grid step of the row [s].
        """
        (north, east, down), velocity, attitude = pose_after(row, ahead)
        home, (drift_north, drift_east) = self._home, row[U_GPS_DRIFT : U_GPS_DRIFT + 2]
        north += row[U_GPS_OFFSET] + self._drift(0, drift_north)
        east += row[U_GPS_OFFSET + 1] + self._drift(1, drift_east)
        answer = _ANSWER % (
            to_seconds(time) * _ROUND_UP,
            *row[M_GYRO : M_GYRO + 3],
            *row[M_ACCEL : M_ACCEL + 3],
            north - home[0],
            east - home[1],
            down - home[2],
            velocity[0] + drift_north,
            velocity[1] + drift_east,
            velocity[2],
            *attitude,
            row[S_VOLTS],
            row[S_AMPS],
            row[M_RANGE],
        )
        return answer.encode("ascii")

    def _drift(self, axis: int, speed: float) -> float:
        """Return how far the receiver is off: of the firmware's sensors it alone takes the position."""
        self._drifted[axis] = self._drifted[axis] + speed * to_seconds(self._period) if speed else 0.0
        return self._drifted[axis]


class ArduPilotExchange:
    """The JSON port of one ArduPilot; see ``Exchange``.

    Args:
        process: The firmware; its first socket is that of ``JSON_PORT``.
        home: North, east, down of the firmware's home about the world's origin [m].
        commands: Motor commands of the pulse widths.
        period: Time between two exchanges.
    """

    def __init__(self, process: FirmwareProcess, home: Vector, commands: Commands, period: Ns) -> None:
        self.period = period
        self._process, self._answers, self._commands = process, Answers(home, period), commands
        self._socket = process.sockets[0]
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", 1, 0))
        self._asked = -1
        self._address: Any = None
        self._answer = b""
        self._transmitter = "127.0.0.1", _TRANSMITTER_PORT.of(process.instance)

    def prepare(self, time: Ns, row: Sequence[float], ahead: float) -> None:
        """See ``Exchange``."""
        self._answer = self._answers.answer(time, row, ahead)

    def send(self) -> None:
        """See ``Exchange``."""
        if self._address is None:
            self.receive()  # it asks first
        self._socket.sendto(self._answer, self._address)

    def transmit(self, pulses: Sequence[int]) -> None:
        """See ``Exchange``."""
        self._socket.sendto(_TRANSMITTER.pack(*pulses), self._transmitter)

    def receive(self) -> Sequence[float]:
        """See ``Exchange``."""
        for _ in range(int(ANSWER_LIMIT_S)):
            try:
                while True:
                    octets, self._address = self._socket.recvfrom(LARGEST_QUESTION)
                    try:
                        number, pulses = question_in(octets)
                    except ValueError as error:
                        raise self._process.error(f"sends {error}") from None
                    if number != self._asked:  # else a copy of the last question, sent while we computed
                        self._asked = number
                        return self._commands(pulses)
            except BlockingIOError:
                if self._process.ending():
                    break
        raise self._process.error(f"has not answered for {ANSWER_LIMIT_S:g} s")


def exchange_period(kind: str, parameters: Mapping[str, float]) -> Ns:
    """Return the time between two exchanges: two in each main loop, in whole microseconds.

    A gyroscope gives one sample for each exchange. From 4.6 on a firmware does not arm with fewer than 1.8
    samples for each loop.
    """
    rate = parameters.get(LOOP_RATE, _USUAL_LOOP_RATE_HZ[kind])
    return period_of(_SAMPLES * rate)


def period_of(rate: float) -> Ns:
    """Return the time between two exchanges at a rate [Hz]: whole microseconds, as a firmware counts."""
    return int(S / US / rate) * US


def _multirotor_commands(rotors: int) -> Commands:
    def commands(pulses: Sequence[int]) -> Sequence[float]:
        return [_THROTTLES[pulse] for pulse in pulses[:rotors]]

    return commands


def _signed(pulse: int) -> float:
    """Return a pulse about 1500 us as -1..1; a channel without a function has pulses of 0."""
    return min(max((pulse - 1500) / 500, -1.0), 1.0) if pulse else 0.0


def _rover_commands(pulses: Sequence[int]) -> Sequence[float]:
    return -_signed(pulses[0]), _signed(pulses[2])


def _skid_commands(pulses: Sequence[int]) -> Sequence[float]:
    left, right = _signed(pulses[0]), _signed(pulses[2])
    return 0.5 * (right - left), 0.5 * (left + right)


def commands_of(spec: BodySpec) -> Commands:
    """Return the function from a firmware's outputs to the motor commands of a body."""
    if isinstance(spec, Multirotor):
        return _multirotor_commands(len(spec.rotors))
    return _skid_commands if spec.skid else _rover_commands


_CLASSES = {"quad": 1.0, "hexa": 2.0, "octo": 3.0}
_FRAMES = {name: (_CLASSES[name.partition("-")[0]], 1.0 if name.endswith("-x") else 0.0) for name in FRAMES}
"""Class and type of a frame, as FRAME_CLASS and FRAME_TYPE have them."""


def airframe_parameters(spec: BodySpec) -> dict[str, float]:
    """Return the parameters that fit the firmware to a body, as a builder would set them.

    A firmware as it is shipped refuses to arm: its frame is not stated and its compass was never calibrated.
    """
    found: dict[str, float] = {
        "AHRS_EKF_TYPE": 3.0,  # 10, the true state, is the default of 4.6 for a world that sets the pace
        "BATT_MONITOR": 4.0,
        "BATT_CAPACITY": 1000.0 * spec.battery.capacity_ah,
        **{
            f"{name}_{axis}": _COMPASS_OFFSET
            for number in ("1", "2", "3")
            for name in (f"COMPASS_OFS{number.strip('1')}", f"SIM_MAG{number}_OFS")
            for axis in "XYZ"
        },
    }
    if not isinstance(spec, Multirotor):
        circle = spec.wheelbase / tan(radians(spec.steer_top_deg))  # the smallest radius [m]
        steering = {
            "ATC_STR_RAT_FF": circle,
            "TURN_RADIUS": circle,
        }  # full steering at MOT_SPD_SCA_BASE, 1 m/s
        if spec.skid:
            full = {"ATC_STR_RAT_FF": 1.0 / radians(spec.turn_top_deg)}
            steering = {"SERVO1_FUNCTION": 73.0, "SERVO3_FUNCTION": 74.0, **full}
        return found | {
            "SERVO1_MIN": 1000.0,
            "SERVO1_MAX": 2000.0,
            "SERVO3_MIN": 1000.0,
            "SERVO3_MAX": 2000.0,
            "CRUISE_SPEED": _CRUISE_SPEED,
            "CRUISE_THROTTLE": 100.0 * _CRUISE_SPEED / spec.speed_top,
            **steering,
        }
    frame_class, frame_type = _FRAMES[spec.frame or "quad-x"]
    cells = spec.battery.cells
    return found | {
        "FRAME_CLASS": frame_class,
        "FRAME_TYPE": frame_type,
        "MOT_PWM_MIN": 1000.0,
        "MOT_PWM_MAX": 2000.0,
        "MOT_BAT_VOLT_MAX": 4.2 * cells,
        "MOT_BAT_VOLT_MIN": 3.3 * cells,
        "MOT_THST_HOVER": spec.hover_throttle * spec.hover_throttle,
    }


def _mode_names(kind: str) -> Callable[[int], str]:
    modes = COPTER_MODES if kind == "multirotor" else ROVER_MODES
    names = {mode.number: mode.name for mode in modes}
    return lambda number: names.get(number, f"MODE {number}")


def defaults_text(parameters: Mapping[str, float]) -> str:
    """Return the text of a file for the option ``--defaults``."""
    return "".join(f"{name} {value:.9g}\n" for name, value in parameters.items())


def home_option(flight: Flight) -> str:
    """Return the option that states where a body stands now, before anything has moved it."""
    latitude, longitude, amsl = flight.frame.from_enu(flight.truth().position)
    return f"--home={latitude:.9f},{longitude:.9f},{amsl:.4f},{flight.spec.heading_deg:.4f}"


def start(asked: Assignment) -> FirmwareInstance:
    """Start an ArduCopter or an ArduRover.

    Raises:
        FirmwareError: It cannot be started.
    """
    flight = asked.flight
    kind = "multirotor" if flight.flying else "rover"
    own = airframe_parameters(flight.spec)
    if asked.repeatable:
        own["LOG_BACKEND_TYPE"] = 0.0  # its logger is a thread that arming waits for
    asked.folder.mkdir(parents=True, exist_ok=True)
    parameters = own | dict(asked.parameters)
    (asked.folder / _DEFAULTS).write_text(defaults_text(parameters), "ascii")
    east, north, up = flight.truth().position
    process = FirmwareProcess(
        asked.name,
        [
            str(asked.program),
            "--model=JSON:127.0.0.1",
            "-I{instance}",
            home_option(flight),
            f"--defaults={_DEFAULTS}",
            f"--sysid={asked.system}",
            f"--start-time={_START_TIME}",
            "--serial0=udpclient:127.0.0.1:{port1}",
        ],
        asked.folder,
        sockets=(JSON_PORT, GROUND_PORT),
        listens=LISTENS,
    )
    period = exchange_period(kind, parameters)
    exchange = ArduPilotExchange(process, (north, east, -up), commands_of(flight.spec), period)
    connection = UdpConnection(process.sockets[1])
    return FirmwareInstance(
        process,
        exchange,
        connection,
        _mode_names(kind),
        _KINDS[kind],
        arms_lost=True,
        parameters=asked.parameters.keys(),  # it passes over those that it lacks, without a word
    )
