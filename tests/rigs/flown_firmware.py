"""One vehicle whose autopilot is a program of real firmware, or a stand-in, commanded by a driver."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from socket import socket
from typing import Any, Self

from volery.base.frames import LocalFrame
from volery.base.position import AMSL, Position
from volery.base.time import MS
from volery.kernel.virtual import VirtualKernel
from volery.links.in_process_link import in_process_pair
from volery.run.connect import SCRIPT
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.real_firmware.family import RealFirmwareFamily
from volery.simulation.real_firmware.lock_step import RealFirmware
from volery.simulation.world.body_specs import BodySpec, Multirotor
from volery.vehicles import Drone, Rover, Vehicle
from volery.vehicles.driver import drivers

FRAME = LocalFrame(46.0825, -103.8995, 900.0)


class FlownFirmware:
    """A world with one body whose firmware is warmed up, and the vehicle that commands it."""

    def __init__(
        self,
        project: str,
        program: Path,
        folder: Path,
        *,
        spec: BodySpec | None = None,
        parameters: Mapping[str, float] | None = None,
        repeatable: bool = True,
    ) -> None:
        self.kernel = VirtualKernel()
        spec = spec or Multirotor()
        self.world, (self.flight,) = make_world(self.kernel.now, [spec], seed=1, frame=FRAME)
        family = RealFirmwareFamily(name=project, program=program, folder=folder, repeatable=repeatable)
        self._project, self._folder = project, folder
        self.commands: list[tuple[float, ...]] = []
        """What the motors were commanded, exchange by exchange."""
        command = self.world.command_motors

        def note(body: int, commands: Any) -> None:
            self.commands.append(tuple(commands))
            command(body, commands)

        self.world.command_motors = note  # type: ignore[method-assign]
        self.autopilot: RealFirmware = family.create(
            self.kernel, self.flight, parameters=parameters, name="drone_1"
        )
        self.vehicle: Any = None

    def watch(self, pulses: list[tuple[int, ...]], answers: list[bytes], said: dict[int, bytes]) -> None:
        """Note the pulses of each question, each answer, and what is said, by the question before it."""
        exchange: Any = self.autopilot._exchange
        ground: Any = self.autopilot._ground
        exchange._socket = _Watched(exchange._socket, pulses, answers)
        read = ground._connection.read

        def note() -> bytes:
            octets: bytes = read()
            if octets:
                said[len(pulses) - 1] = said.get(len(pulses) - 1, b"") + octets
            return octets

        ground._connection.read = note

    def __enter__(self) -> Self:
        return self

    def open(self) -> Vehicle:
        """Warm it up and return the vehicle."""
        self.autopilot.start(warm=True)
        ours, theirs = in_process_pair(self.kernel, 2 * MS, "drone_1")
        self.autopilot.connect(theirs)
        on_link = drivers.load(self._project).on_link
        assert on_link is not None
        kind = Drone if self.flight.flying else Rover
        self.vehicle = kind(self.kernel, "drone_1", on_link(self.kernel, ours, "drone_1", {}))
        return self.vehicle

    def place(self, east: float, north: float, up: float) -> Position:
        """Return a point of the world."""
        latitude, longitude, amsl = FRAME.from_enu((east, north, up))
        return Position(latitude, longitude, AMSL(amsl))

    def as_script(self) -> Any:
        """Return the context in which the caller commands the vehicle."""
        return self.kernel.adopt(SCRIPT)

    def __exit__(self, *_: object) -> None:
        if self.vehicle is not None:
            self.vehicle.close()
        self.autopilot.close()


class _Watched:
    """The socket of an exchange with an ArduPilot."""

    def __init__(self, real: socket, pulses: list[tuple[int, ...]], answers: list[bytes]) -> None:
        self._real, self._pulses, self._answers = real, pulses, answers

    def recvfrom(self, size: int) -> Any:
        octets, address = self._real.recvfrom(size)
        _, _, number, *widths = struct.unpack_from("<HHI16H", octets)
        if number == len(self._pulses):
            self._pulses.append(tuple(widths))
        return octets, address

    def sendto(self, octets: bytes, address: Any) -> int:
        self._answers.append(octets)
        return self._real.sendto(octets, address)
