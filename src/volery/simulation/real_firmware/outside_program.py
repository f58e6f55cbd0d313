"""A vehicle that a program flies which others have started, and which asks over ArduPilot's JSON interface.

It may be a firmware or anybody's controller. It moves the time of the world: its question waits for its
samples, and the world waits for its question, however long that takes.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable, MutableSequence, Sequence
from math import nan
from typing import Any

from volery.base.errors import CapabilityError, UsageError
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.links.link import Link
from volery.ros.graph import RosGraph
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.real_firmware.ardupilot import (
    LARGEST_QUESTION,
    Answers,
    commands_of,
    question_in,
)
from volery.simulation.real_firmware.firmware_faults import WAYS, ByParameters
from volery.simulation.real_firmware.lock_step import READ_EVERY
from volery.simulation.world.world import STEP
from volery.trace.events import VehicleState

_LOOK_EVERY_US = 200_000
"""Longest single wait for a question: after it one looks whether the run is to end."""
SILENCE_LIMIT_S = 10.0
"""Time of the wall clock after which a program that does not ask is called silent."""
_CONTEST = 100
"""A program that asks again within so many questions of the one that took its place has not ended."""
_NOBODY: Any = None


class QuestionPort:
    """The UDP port at which the program of one vehicle asks.

    Args:
        name: The vehicle, for messages.
        host: Address of this computer to listen at.
        port: Its UDP port.
        tell: Receives a line when a program begins, is silent, or sends what is no question.
        stopped: Whether the run is to end, so that no question is waited for any more.

    Raises:
        UsageError: The port cannot be opened.
    """

    def __init__(
        self, name: str, host: str, port: int, tell: Callable[[str], None], stopped: Callable[[], bool]
    ) -> None:
        self._name, self._tell, self._stopped = name, tell, stopped
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise UsageError(
                f"{name}: UDP port {port} of {host} cannot be opened: {error}; end the program that has it, "
                "or give another with --json HOST:PORT"
            ) from None
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", 0, _LOOK_EVERY_US))
        host, port = self._socket.getsockname()
        self.address = f"{host}:{port}"
        """Where it listens."""
        self.programs = 0
        """Number of programs that have asked so far, one after the other."""
        self._peer = self._earlier = _NOBODY
        self._asked = -1
        self._questions = 0  # of the present program
        self._strange = False

    def question(self) -> Sequence[int] | None:
        """Wait for the next question and return its pulse widths [us]; None: the run is to end.

        Raises:
            UsageError: Two programs ask.
        """
        looks = 0
        while not self._stopped():
            try:
                octets, address = self._socket.recvfrom(LARGEST_QUESTION)
            except BlockingIOError:
                looks += 1
                if self._peer is not _NOBODY and looks * _LOOK_EVERY_US == SILENCE_LIMIT_S * 1e6:
                    self._tell(
                        f"{self._name}: no question for {SILENCE_LIMIT_S:g} s; the world waits for one at "
                        f"{self.address}"
                    )
                continue
            try:
                number, pulses = question_in(octets)
            except ValueError as error:
                self._note_strange(address, error)
                continue
            if address != self._peer:
                self._begin(address)
            elif number == self._asked:
                continue  # a copy: the world computed meanwhile
            self._asked = number
            self._questions += 1
            return pulses
        return None

    def _begin(self, address: Any) -> None:
        """Take a program that asks for the first time."""
        if address == self._earlier and self._questions < _CONTEST:
            raise UsageError(
                f"{self._name}: two programs ask at {self.address}, from UDP ports {address[1]} and "
                f"{self._peer[1]}; end one, or start it for another vehicle: -I1 asks 10 ports above -I0"
            )
        self._peer, self._earlier = address, self._peer
        self._questions = 0
        self.programs += 1
        what = "is connected" if self.programs == 1 else "takes the place of the last"
        self._tell(f"{self._name}: a program at {address[0]}:{address[1]} {what}")

    def _note_strange(self, address: Any, error: ValueError) -> None:
        if not self._strange:
            self._strange = True
            self._tell(
                f"{self._name}: what {address[0]}:{address[1]} sends to {self.address} is not answered: "
                f"{error}. A question has 40 or 72 octets, as those of arducopter --model=JSON:HOST"
            )

    def answer(self, octets: bytes) -> None:
        """Answer the last question."""
        self._socket.sendto(octets, self._peer)

    def close(self) -> None:
        """Close it."""
        self._socket.close()


class OutsideProgram:
    """A ``FleetAutopilot`` that is a program of others. Its estimate and its mode are not known.

    Args:
        kernel: Clock and timers.
        flight: The body, at the program's home.
        name: Name of the vehicle.
        port: Where the program asks.
        period: Time between two exchanges.
    """

    banner = b""

    def __init__(self, kernel: Kernel, flight: Flight, name: str, port: QuestionPort, period: Ns) -> None:
        self.transmitter: MutableSequence[int] = [0] * 16
        self.next_step = 0
        """See ``Attendant``."""
        self._kernel, self._flight, self._name, self._port, self._period = kernel, flight, name, port, period
        east, north, up = flight.truth().position
        self._answers = Answers((north, east, -up), period)
        self._commands = commands_of(flight.spec)
        self._due: Ns = -(-kernel.now() // period) * period
        self._began: Ns = 0  # when the present program asked first
        self._programs = 0
        self._turning = False
        resting = [0.0] * (flight.rotors or 2)
        flight.drive_motors(resting)
        self.next_step = self._due // STEP
        flight.attend(self)
        self._reading = kernel.every(READ_EVERY, flight.advance)

    def attend(self) -> None:
        """See ``Attendant``: take the motor commands of the next question, and answer it."""
        pulses: Sequence[int] | None = None
        try:
            pulses = self._port.question()
        finally:
            if pulses is None:  # the run is to end: time goes on without the program
                self._flight.attend(None)
        if pulses is None:
            return
        if self._port.programs != self._programs:
            self._programs, self._began = self._port.programs, self._due
        commands = self._commands(pulses)
        self._turning = any(commands)
        self._flight.command_motors(commands)
        ahead = 1e-9 * (self._due - self.next_step * STEP)
        self._port.answer(self._answers.answer(self._due - self._began, self._flight.row, ahead))
        self._due += self._period
        self.next_step = self._due // STEP

    def swap_battery(self) -> None:
        """Fly on a full battery from now on."""
        self._flight.set_charge(1.0)

    def require(self, kind: str, fault: str) -> None:
        """Refuse a fault of a sensor that the program simulates itself: only its link is served here.

        Raises:
            CapabilityError: It is one.
        """
        way = WAYS["ardupilot"].get(kind)
        if isinstance(way, ByParameters):
            names = ", ".join(" or ".join(setting.name for setting in group) for group in way.settings)
            raise CapabilityError(
                f"fault {fault}: {self._name}: a program that others start cannot be given {kind}; leave the "
                f"fault out, and set its parameters yourself: of ArduPilot {names}"
            )

    def connect(self, link: Link, *, use: str = "") -> None:
        """See ``FleetAutopilot``."""
        raise UsageError(f"{self._name}: its program was started by others; connect to the program itself")

    def join(self, graph: RosGraph, namespace: str, place: ExecutionContext) -> None:
        """See ``FleetAutopilot``."""
        raise UsageError(f"{self._name}: its program was started by others; it has no node here")

    def state(self) -> VehicleState:
        """See ``FleetAutopilot``; it counts as armed while a motor turns."""
        seen = self._flight.truth()
        return VehicleState(
            self._kernel.now(),
            self._name,
            *seen.position,
            *seen.attitude,
            *seen.velocity,
            *(nan, nan, nan),
            seen.battery_left,
            seen.volts,
            seen.amps,
            self._turning,
            "",
        )

    def close(self) -> None:
        """Close its port; the program waits for answers then. The state can still be read."""
        self._flight.attend(None)
        self._reading.cancel()
        self._port.close()
