"""PX4's simulator link: samples as HIL_SENSOR and HIL_GPS, motor commands as HIL_ACTUATOR_CONTROLS, over TCP.

PX4's clock is the time in HIL_SENSOR. It answers each once its controllers have run, with that time; a
time that it has had already it does not answer at all. While its start script runs it does not answer either.
Source: src/modules/simulation/simulator_mavlink of PX4; behaviour as measured with 1.14 and 1.17.

All samples are those of the body's sensors, and so is the battery: PX4's own simulation of one is left out.
Commands of a ground station are read by a thread that the clock does not wait for. So each is followed by a
PING, whose answer says that the commands before it have been read.
"""

from __future__ import annotations

import re
import select
import shutil
import socket
import struct
from collections.abc import Callable, Mapping, Sequence, Set
from functools import partial
from math import hypot, sqrt
from pathlib import Path

from volery.base.errors import UsageError
from volery.base.frames import ned_to_enu
from volery.base.time import MS, US, Ns, S
from volery.links.mavlink_codec import CHECKSUM, HEADER, STX
from volery.links.mavlink_messages import constant, message_type
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.px4.airframes import COPTER_MODES
from volery.simulation.autopilots.px4.modes import main_and_sub
from volery.simulation.real_firmware.exchange import ANSWER_LIMIT_S
from volery.simulation.real_firmware.firmware_instance import Assignment, FirmwareInstance
from volery.simulation.real_firmware.firmware_process import FirmwareError, FirmwareProcess, LoopbackPort
from volery.simulation.real_firmware.ground_link import STATION, UdpConnection
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.dynamics import CELL_FULL_VOLTS
from volery.simulation.world.environment_models import pressure_at
from volery.simulation.world.state_layout import (
    M_ACCEL,
    M_BARO,
    M_BARO_COUNT,
    M_GPS,
    M_GPS_COUNT,
    M_GPS_FIX,
    M_GPS_VELOCITY,
    M_GYRO,
    M_MAG,
    M_MAG_COUNT,
    M_RANGE,
    P_CAPACITY,
    P_MAX_RANGE,
    S_AMPS,
    S_CHARGE,
    S_VOLTS,
    U_BARO_BLOCKED,
    U_MAG_BLOCKED,
)

SIMULATOR_PORT = LoopbackPort("tcp", 4560, 1)
"""Where this program waits for the firmware's simulator link, which connects."""
GROUND_PORT = LoopbackPort("udp", 14_540, 1)
"""Where the firmware sends its telemetry."""
_FIRMWARE_GROUND_PORT = LoopbackPort("udp", 14_580, 1)
"""Where it receives commands."""
_LOCK_FILE = "/tmp/px4_lock-{instance}"
"""What a PX4 locks: its tools find it by its instance number."""
PERIOD: Ns = 4 * MS
"""Time between two exchanges: that of IMU_INTEG_RATE, as PX4 sets it for this link."""
CLOCK_START: Ns = S
"""PX4's clock at its start: 0 means unset to it."""
BATTERY_EVERY: Ns = S // 2
"""Time between two reports of the battery; PX4 misses one after 5 s."""
RANGE_EVERY: Ns = 48 * MS
_NO_FIX_EVERY: Ns = 200 * MS
"""Time between two reports of a receiver without a fix, and between two samples of the range finder."""
_STUCK_EVERY: Ns = 52 * MS
"""Time between two samples of a stuck barometer or magnetometer, a multiple of ``PERIOD``."""
_START_TIME_US = 1_700_000_000_000_000
"""UTC of the firmware's start [us]."""

_KINDS = {4: 2, 6: 13, 8: 14}
"""MAV_TYPE by the number of rotors: quadrotor, hexarotor, octorotor."""
_LOCK_STEP = 0x01
"""Flag of HIL_ACTUATOR_CONTROLS: the firmware waits for its samples."""
_INERTIAL, _MAGNETIC, _BAROMETRIC = 0x003F, 0x01C0, 0x1A00
"""``fields_updated`` of HIL_SENSOR; a group that is not whole is ignored."""
_NOT_KNOWN = 0xFFFF
_LEAST_ACCURACY_CM = 10
_SATELLITES = 10
_GROUND_TEMPERATURE = 15.0
_DITHER_PA, _DITHER_GAUSS = 0.05, 1e-5
"""PX4 takes a sensor whose values repeat for stale, as those of a perfect one do at rest."""

_START_WAIT_S = 0.001
"""Time for the answer of a firmware that is at rest: it is there, or there is none."""
_PING_WAIT_MS = 1
"""Time for the answer to a PING before it matters whether the firmware is at rest."""

_AIRFRAME = "22090_volery"
_MODEL = "volery"
_ENVIRONMENT = {
    "PX4_SIM_MODEL": _MODEL,
    "PX4_SYS_AUTOSTART": "",
    "PX4_SIMULATOR": "",
    "PX4_SIM_HOSTNAME": "",
    "PX4_SIM_HOST_ADDR": "",
    "PX4_SIM_SPEED_FACTOR": "",
}
"""What the start script reads, so that nothing of the user's environment changes the vehicle."""
_MEMORY = ("parameters.bson", "parameters_backup.bson", "dataman")
"""What a PX4 remembers from one start to the next."""


class Outgoing:
    """A MAVLink message with values in the order of the wire: packed in a quarter of the time of ``encode``.

    Args:
        name: Name of the message.
        layout: Its payload, as of ``struct``.
        sender: System and component that it comes from.
    """

    def __init__(self, name: str, layout: str, sender: tuple[int, int] = (STATION, 1)) -> None:
        self._kind, self._payload = message_type(name), struct.Struct(f"<{layout}")
        low, high = self._kind.id & 0xFFFF, self._kind.id >> 16
        header = HEADER.pack(STX, self._payload.size, 0, 0, 0, *sender, low, high)
        self._start, self._covered = header[:1], header[1:]

    def pack(self, *values: float) -> bytes:
        """Return the frame; its number is always 0, as TCP loses none."""
        covered = self._covered + self._payload.pack(*values)
        return self._start + covered + CHECKSUM.pack(self._kind.checksum(covered))


SENSOR = Outgoing("HIL_SENSOR", "QfffffffffffffIB")
GPS = Outgoing("HIL_GPS", "QiiiHHHhhhHBBBH")
TRANSMITTER = Outgoing("RC_CHANNELS", "I18HBB")
RANGE = Outgoing("DISTANCE_SENSOR", "IHHHBBBBff4fB")
_PING = Outgoing("PING", "QIBB")
_CONTROLS = message_type("HIL_ACTUATOR_CONTROLS")
_CONTROLS_PAYLOAD = struct.Struct("<QQ16fB")
_AROUND = HEADER.size + CHECKSUM.size
_PING_ID = message_type("PING").id.to_bytes(3, "little")
_PING_TARGET = HEADER.size + 12
_STATION_OCTET = bytes([STATION])

_NED_DOWN = constant("MAV_SENSOR_ROTATION_PITCH_270")
_LASER = constant("MAV_DISTANCE_SENSOR_LASER")


class Controls:
    """HIL_ACTUATOR_CONTROLS.

    Attributes:
        time: Time of the samples that it answers [us].
        lock_step: Whether the firmware waits for its samples.
        values: Commands of the outputs.
    """

    def __init__(self, payload: bytes) -> None:
        padded = payload.ljust(_CONTROLS_PAYLOAD.size, b"\0")
        self.time, flags, *values, _ = _CONTROLS_PAYLOAD.unpack_from(padded)
        self.lock_step = bool(flags & _LOCK_STEP)
        self.values: list[float] = values


class ControlsReader:
    """Finds HIL_ACTUATOR_CONTROLS among the messages on a simulator link."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, octets: bytes) -> list[Controls]:
        """Return those that *octets* complete.

        Raises:
            ValueError: The octets are no MAVLink 2.
        """
        octets = self._rest + octets
        found, start = [], 0
        while len(octets) - start >= _AROUND:
            _, size, _, _, _, _, _, low, high = HEADER.unpack_from(octets, start)
            if octets[start] != STX:
                raise ValueError(f"octet {octets[start]:#04x} where a frame should begin")
            end = start + HEADER.size + size
            if len(octets) < end + CHECKSUM.size:
                break
            if low | high << 16 == _CONTROLS.id:
                (checksum,) = CHECKSUM.unpack_from(octets, end)
                if _CONTROLS.checksum(octets[start + 1 : end]) != checksum:
                    raise ValueError("a frame with a wrong checksum")
                found.append(Controls(octets[start + HEADER.size : end]))
            start = end + CHECKSUM.size
        self._rest = octets[start:]
        return found


class Px4GroundConnection(UdpConnection):
    """The telemetry port of a PX4: what is written has been read when ``write`` returns.

    A request for a stream is carried out only as the clock goes on, and what follows it is read thereafter.

    Args:
        bound: See ``UdpConnection``.
        peer: See ``UdpConnection``.
        at_rest: Waits until the firmware has nothing to do, and returns whether that is so.
    """

    def __init__(self, bound: socket.socket, peer: tuple[str, int], at_rest: Callable[[], bool]) -> None:
        super().__init__(bound, peer)
        self._at_rest = at_rest
        self._arrival = select.poll()
        self._arrival.register(bound, select.POLLIN)
        self._received: list[bytes] = []
        self._pings = 0
        self._answers = False

    def read(self) -> bytes:
        """See ``Connection``."""
        self._take()
        octets = b"".join(self._received)
        self._received.clear()
        return octets

    def write(self, octets: bytes) -> None:
        """See ``Connection``; before the firmware has sent anything, it is not waited for."""
        super().write(octets)
        if not self._answers:
            return
        self._pings += 1
        super().write(_PING.pack(0, self._pings, 0, 0))
        while not self._take():
            if not self._arrival.poll(_PING_WAIT_MS) and self._at_rest():
                return

    def _take(self) -> bool:
        """Take what has arrived; return whether the last PING is answered."""
        answered = False
        while octets := self.datagram():
            self._answers = True
            # its own PINGs, to all, end before the target: zeros at the end are left out
            if octets[7:10] == _PING_ID and octets[_PING_TARGET : _PING_TARGET + 1] == _STATION_OCTET:
                answered |= octets[HEADER.size + 8] == self._pings & 0xFF
            else:
                self._received.append(octets)
        return answered


class Px4Exchange:
    """The simulator link of one PX4; see ``Exchange``.

    Args:
        process: The firmware; its first socket is that of ``SIMULATOR_PORT``.
        flight: Its body.
        ground: Its telemetry port.
        system: Its MAVLink system id.
        parameters: Names of the parameters that must exist.
        repeatable: Whether it pauses after each answer, so that the next is the same in each run.
    """

    period = PERIOD

    def __init__(
        self,
        process: FirmwareProcess,
        flight: Flight,
        ground: Px4GroundConnection,
        system: int,
        parameters: Set[str],
        *,
        repeatable: bool,
    ) -> None:
        self._process, self._frame, self._ground, self._parameters = process, flight.frame, ground, parameters
        self._listener = process.sockets[0]
        self._peer: socket.socket | None = None
        self._reader = ControlsReader()
        self._motors, self._cells = flight.rotors, flight.spec.battery.cells
        self._repeatable = repeatable
        sigma = flight.sigma
        self._accuracy = _accuracy(sigma.horizontal), _accuracy(sigma.vertical)
        self._battery = Outgoing(
            "BATTERY_STATUS", "iihHHHHHHHHHHhBBBb", (system, constant("MAV_COMP_ID_BATTERY"))
        )
        self._time = 0  # of the samples that were made last [us]
        self._sent = 0  # of those that were sent last [us]
        self._samples = self._battery_report = b""
        self._answering = False  # the start script has ended
        self._counts = [-1.0, -1.0, -1.0]
        self._dither = 1.0
        self._field: Sequence[float] = (0.0, 0.0, 0.0)  # the last sample of the magnetometer, as it was sent
        self._air = 0.0, 0.0  # the last one of the barometer: pressure [Pa], temperature [deg C]

    def prepare(self, time: Ns, row: Sequence[float], ahead: float) -> None:
        """See ``Exchange``; a period is a whole number of the world's steps, so *ahead* is 0."""
        time += CLOCK_START
        self._time = time // US
        octets = b""
        self._battery_report = self._battery_status(row) if time % BATTERY_EVERY < PERIOD else b""
        if time % RANGE_EVERY < PERIOD and row[P_MAX_RANGE]:
            octets += self._range(row)
        if row[M_GPS_COUNT] != self._counts[0] or (not row[M_GPS_FIX] and time % _NO_FIX_EVERY < PERIOD):
            self._counts[0] = row[M_GPS_COUNT]
            octets += self._fix(row)
        self._samples = octets + self._sensors(row)

    def send(self) -> None:
        """See ``Exchange``."""
        if self._answering and self._battery_report:
            self._ground.write(self._battery_report)
        self._sent = self._time
        self._write(self._samples)

    def _sensors(self, row: Sequence[float]) -> bytes:
        fields = _INERTIAL
        field: Sequence[float] = row[M_MAG : M_MAG + 3]
        pascals, degrees = 0.0, 0.0
        repeats = self._time * US % _STUCK_EVERY < PERIOD
        if row[M_MAG_COUNT] != self._counts[1]:
            self._counts[1] = row[M_MAG_COUNT]
            self._dither = -self._dither
            field = self._field = field[0] + self._dither * _DITHER_GAUSS, field[1], field[2]
            fields |= _MAGNETIC
        elif repeats and row[U_MAG_BLOCKED]:
            field = self._field
            fields |= _MAGNETIC
        if row[M_BARO_COUNT] != self._counts[2]:
            self._counts[2] = row[M_BARO_COUNT]
            amsl = self._frame.amsl + row[M_BARO]
            pascals = pressure_at(amsl) + self._dither * _DITHER_PA
            degrees = _GROUND_TEMPERATURE - 0.0065 * amsl
            self._air = pascals, degrees
            fields |= _BAROMETRIC
        elif repeats and row[U_BARO_BLOCKED]:
            pascals, degrees = self._air
            fields |= _BAROMETRIC
        accel, gyro = row[M_ACCEL : M_ACCEL + 3], row[M_GYRO : M_GYRO + 3]
        hectopascals = 0.01 * pascals
        return SENSOR.pack(self._time, *accel, *gyro, *field, hectopascals, 0.0, 0.0, degrees, fields, 0)

    def _fix(self, row: Sequence[float]) -> bytes:
        fix = int(row[M_GPS_FIX])
        position = ned_to_enu((row[M_GPS], row[M_GPS + 1], row[M_GPS + 2]))
        latitude, longitude, amsl = self._frame.from_enu(position)
        north, east, down = (round(100.0 * each) for each in row[M_GPS_VELOCITY : M_GPS_VELOCITY + 3])
        return GPS.pack(
            _START_TIME_US + self._time,
            round(1e7 * latitude),
            round(1e7 * longitude),
            round(1000.0 * amsl),
            *self._accuracy,
            round(hypot(north, east)),
            north,
            east,
            down,
            _NOT_KNOWN,
            fix,
            _SATELLITES if fix else 0,
            0,
            0,
        )

    def _range(self, row: Sequence[float]) -> bytes:
        reach = round(100.0 * row[P_MAX_RANGE])
        distance = round(100.0 * row[M_RANGE]) if row[M_RANGE] >= 0.0 else reach + 1
        times = self._time // 1000, 1, reach, distance
        return RANGE.pack(*times, _LASER, 0, _NED_DOWN, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)

    def _battery_status(self, row: Sequence[float]) -> bytes:
        cells = min(self._cells, 10)
        millivolts = round(1000.0 * row[S_VOLTS] / cells)
        volts = (millivolts,) * cells + (_NOT_KNOWN,) * (10 - cells)
        left = max(0.0, 1.0 - row[S_CHARGE] / row[P_CAPACITY])
        return self._battery.pack(
            round(row[S_CHARGE] / 3.6), -1, 2500, *volts, min(round(100.0 * row[S_AMPS]), 0x7FFF), 0, 0, 0,
            round(100.0 * left),
        )  # fmt: skip

    def transmit(self, pulses: Sequence[int]) -> None:
        """See ``Exchange``."""
        channels = (*pulses, _NOT_KNOWN, _NOT_KNOWN)
        self._write(TRANSMITTER.pack(self._sent // 1000, *channels, len(pulses), 100))

    def receive(self) -> Sequence[float]:
        """See ``Exchange``; while the start script runs the motors stand still."""
        if not self._answering:
            return self._go_on_starting()
        for _ in range(int(ANSWER_LIMIT_S)):
            answer = self._answer()
            if answer is not None:
                if self._repeatable:
                    self._process.rest(started=True)
                return answer
            if self._process.ending():
                break
        raise self._process.error(f"has not answered for {ANSWER_LIMIT_S:g} s")

    def _go_on_starting(self) -> Sequence[float]:
        self._process.rest(started=False)
        answer = self._answer()
        if answer is None:
            if self._process.ending() or self._sent * US > CLOCK_START + 60 * S:
                raise self._process.error("has not ended its start script after 60 s")
            return (0.0,) * self._motors
        self._answering = True
        self._limit(1.0)
        self._process.refuse_absent(self._parameters, r"Parameter (\w+) not found")
        return answer

    def _limit(self, seconds: float) -> None:
        """Let each wait for an answer end after *seconds*; in the kernel, which saves calls at each step."""
        limit = struct.pack("ll", *divmod(int(1e6 * seconds), 1_000_000))
        self._connected().setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)

    def _answer(self) -> Sequence[float] | None:
        """Return the answer to the last samples; None: there was none within the limit."""
        peer = self._connected()
        while True:
            try:
                octets = peer.recv(4096)
            except BlockingIOError:
                return None
            except OSError:
                octets = b""
            if not octets:
                raise self._process.parting("has closed its simulator link")
            try:
                controls = self._reader.feed(octets)
            except ValueError as error:
                raise self._process.error(f"sends no MAVLink on its simulator link: {error}") from None
            for control in controls:
                if not control.lock_step:
                    raise self._process.error("was built without lock step; build px4_sitl_default")
                if control.time == self._sent:
                    return control.values[: self._motors]

    def _write(self, octets: bytes) -> None:
        try:
            self._connected().sendall(octets)
        except BlockingIOError:
            raise self._process.error(f"has read no samples for {ANSWER_LIMIT_S:g} s") from None
        except OSError:
            raise self._process.parting("has closed its simulator link") from None

    def _connected(self) -> socket.socket:
        if self._peer is not None:
            return self._peer
        self._listener.settimeout(1.0)
        for _ in range(int(ANSWER_LIMIT_S)):
            try:
                self._peer, _ = self._listener.accept()
            except TimeoutError:
                if self._process.ending():
                    break
            else:
                self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                limit = struct.pack("ll", int(ANSWER_LIMIT_S), 0)
                self._peer.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)
                self._limit(_START_WAIT_S)
                self._process.sockets.append(self._peer)  # ends with it
                return self._peer
        raise self._process.error(
            f"has not connected to its simulator link within {ANSWER_LIMIT_S:g} s; name bin/px4 of a "
            "build of px4_sitl_default"
        )


def _accuracy(sigma: float) -> int:
    return max(_LEAST_ACCURACY_CM, min(round(100.0 * sigma), _NOT_KNOWN))


_CROSSOVER = 0.6
"""Crossover of a rate loop times the lag in it: a phase margin of about 50 degrees."""
_EXCHANGE_LAG = 0.010
"""Lag of samples, filters and commands [s]."""
_YAW_CROSSOVER = 6.0
"""The same of the heading's loop at most [rad/s]: a multirotor has little torque about it."""
_RATE_P, _YAW_RATE_P = 0.15, 0.2
"""MC_ROLLRATE_P and MC_YAWRATE_P as PX4 has them."""


def rate_gains(spec: Multirotor) -> tuple[float, float, float]:
    """Return the factors on PX4's rate loops about roll, pitch and yaw that fit them to a body.

    PX4's torque set-point is normalised: 1 about roll and pitch changes the commands of the n rotors that
    act by sqrt(n / 2) in the root of the sum of squares, 1 about yaw by 1 each.
    Source: ControlAllocationPseudoInverse of PX4.
    """
    full = spec.thrust_coefficient * spec.top_speed * spec.top_speed
    scales = []
    for places in ([rotor.left for rotor in spec.rotors], [rotor.forward for rotor in spec.rotors]):
        squares = [place * place for place in places]
        acting = sum(square > 1e-6 for square in squares)
        scales.append(sqrt(2.0 / (acting * sum(squares))))
    scale = max(scales)
    torque = spec.torque_coefficient / spec.thrust_coefficient
    yaw = len(spec.rotors) * full * torque / spec.inertia[2]
    crossover = _CROSSOVER / (spec.rotor_lag + _EXCHANGE_LAG)
    gains = (
        crossover * spec.inertia[0] * scale / (_RATE_P * full),
        crossover * spec.inertia[1] * scale / (_RATE_P * full),
        min(crossover, _YAW_CROSSOVER) / (_YAW_RATE_P * yaw),
    )
    roll, pitch, yaw = (min(max(gain, 0.05), 5.0) for gain in gains)
    return roll, pitch, yaw


def airframe_parameters(spec: Multirotor) -> dict[str, float]:
    """Return the parameters that fit the firmware to a body, as a builder would set them."""
    roll, pitch, yaw = rate_gains(spec)
    hover = spec.hover_throttle * spec.hover_throttle
    torque = spec.torque_coefficient / spec.thrust_coefficient
    rotors = spec.rotors
    return {
        "MAV_TYPE": _KINDS[len(rotors)],
        "CA_AIRFRAME": 0,
        "CA_ROTOR_COUNT": len(rotors),
        **{f"CA_ROTOR{at}_PX": rotor.forward for at, rotor in enumerate(rotors)},
        **{f"CA_ROTOR{at}_PY": -rotor.left for at, rotor in enumerate(rotors)},
        **{f"CA_ROTOR{at}_KM": -rotor.spin * torque for at, rotor in enumerate(rotors)},
        **{f"PWM_MAIN_FUNC{at + 1}": 101 + at for at in range(len(rotors))},
        "THR_MDL_FAC": 1,  # thrust grows with the square of the command
        "MPC_THR_HOVER": min(max(hover, 0.1), 0.8),
        "MPC_THR_MIN": min(0.12, 0.3 * hover),
        "MC_ROLLRATE_K": roll,
        "MC_PITCHRATE_K": pitch,
        "MC_YAWRATE_K": yaw,
        "BAT1_N_CELLS": spec.battery.cells,
        "BAT1_V_CHARGED": CELL_FULL_VOLTS,
        "BAT1_CAPACITY": 1000.0 * spec.battery.capacity_ah,
        "RC_CHAN_CNT": 16,
        "RC_MAP_ROLL": 1,  # how it takes the sticks of a transmitter, if COM_RC_IN_MODE lets it
        "RC_MAP_PITCH": 2,
        "RC_MAP_THROTTLE": 3,
        "RC_MAP_YAW": 4,
        "RC2_REV": -1,
    }


def _start_scripts(asked: Assignment) -> Path:
    """Return the folder ``etc`` that belongs to a program.

    Raises:
        FirmwareError: There is none.
    """
    program = asked.program.resolve()
    for folder in (program.parent.parent / "etc", program.parent / "etc"):
        if (folder / "init.d-posix" / "rcS").is_file():
            return folder
    raise FirmwareError(
        f"{asked.name}: {asked.program} has no start scripts: there is no etc/init.d-posix/rcS in "
        f"{program.parent.parent} or {program.parent}; name bin/px4 of a build of px4_sitl_default"
    )


def write_start_scripts(source: Path, folder: Path, parameters: Mapping[str, float]) -> None:
    """Copy PX4's start scripts to ``folder/etc``, with an airframe that sets *parameters*.

    The copy starts one ground link, and no simulation of a battery.
    """
    target = folder / "etc"
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source, target)
    scripts = target / "init.d-posix"
    settings = "".join(f"param set {name} {value:.9g}\n" for name, value in parameters.items())
    airframe = scripts / "airframes" / _AIRFRAME
    airframe.write_text(f"#!/bin/sh\n. ${{R}}etc/init.d/rc.mc_defaults\n{settings}", "ascii")
    (scripts / "px4-rc.mavlink").write_text(
        f"#!/bin/sh\nmavlink start -x -r 4000000 -u $(({_FIRMWARE_GROUND_PORT.number}+px4_instance))"
        f" -o $(({GROUND_PORT.number}+px4_instance))\n",
        "ascii",
    )
    script = scripts / "rcS"
    text = script.read_text(encoding="utf-8")
    text = re.sub(r"(?m)^(\s*)battery_simulator start", r"\1:", text)
    text = re.sub(r"(?m)^\. px4-alias\.sh$", r"\g<0>\nR=./", text)  # blanks would split an absolute path
    script.write_text(text, "utf-8")


def _mode_name(number: int) -> str:
    mode = COPTER_MODES.get(number)
    return mode.name if mode is not None else "MODE {}.{}".format(*main_and_sub(number))


def start(asked: Assignment) -> FirmwareInstance:
    """Start a PX4 for a multirotor.

    Raises:
        UsageError: The body is a rover.
        FirmwareError: It cannot be started.
    """
    flight = asked.flight
    spec = flight.spec
    if not isinstance(spec, Multirotor):
        raise UsageError(f"{asked.name}: a real PX4 flies multirotors here; give a rover another autopilot")
    source = _start_scripts(asked)
    own = airframe_parameters(spec) | {"MAV_SYS_ID": asked.system}
    if asked.repeatable:
        own |= {"SDLOG_BACKEND": 0, "SDLOG_MODE": -1}  # no logger, to newer and to older versions
        for name in _MEMORY:
            (asked.folder / name).unlink(missing_ok=True)
    try:
        write_start_scripts(source, asked.folder, own | dict(asked.parameters))
    except OSError as error:
        reason = error.args[0][0][2] if isinstance(error, shutil.Error) else error  # the first of many files
        raise FirmwareError(f"{asked.name}: PX4's start scripts cannot be copied: {reason}") from error
    options = ["-i", "{instance}", "-d", "-s", "etc/init.d-posix/rcS", "-w", ".", "etc"]
    process = FirmwareProcess(
        asked.name,
        [str(asked.program), *options],
        asked.folder,
        sockets=(SIMULATOR_PORT, GROUND_PORT),
        listens=(_FIRMWARE_GROUND_PORT,),
        environment=_ENVIRONMENT,
        lock=_LOCK_FILE,
        core=asked.system,  # its threads take turns: on one core that takes less time
    )
    peer = "127.0.0.1", _FIRMWARE_GROUND_PORT.of(process.instance)
    ground = Px4GroundConnection(process.sockets[1], peer, partial(process.rest, started=True))
    exchange = Px4Exchange(
        process, flight, ground, asked.system, asked.parameters.keys(), repeatable=asked.repeatable
    )
    return FirmwareInstance(process, exchange, ground, _mode_name, (_KINDS[len(spec.rotors)],))
