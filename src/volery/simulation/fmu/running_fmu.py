"""An FMU that runs in a process of its own: started, asked for each step, and ended."""

from __future__ import annotations

import json
import shutil
import socket
import struct
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from zipfile import ZipFile

from volery.simulation.fmu.fmu_interface import FmuInterface
from volery.simulation.real_firmware.firmware_process import FirmwareError, FirmwareProcess
from volery.simulation.world.state_layout import STEP_S

_START_LIMIT_S, _ANSWER_LIMIT_S = 60, 10
"""Time of the wall clock after which an FMU hangs: until it is initialised, and in a step."""
_EXTRACTED = "extracted"


class RunningFmu:
    """An FMU that is loaded and waits for its first inputs.

    Args:
        name: The vehicle, for messages.
        interface: The FMU.
        folder: Folder for what it prints and, while it runs, for its extracted files.

    Raises:
        FirmwareError: It cannot be started.
    """

    def __init__(self, name: str, interface: FmuInterface, folder: Path) -> None:
        self.interface = interface
        self._extracted = folder / _EXTRACTED
        self._inputs = struct.Struct(f"{interface.inputs.size}d")
        self._outputs = struct.Struct(f"=i{interface.outputs.size}d")
        self._initialised = False
        asked = {
            "folder": str(self._extracted),
            "identifier": interface.identifier,
            "token": interface.token,
            "version": interface.version,
            "step": STEP_S,
            "parameters": interface.parameters,
            "inputs": (interface.inputs.references, interface.inputs.size),
            "outputs": (interface.outputs.references, interface.outputs.size),
        }
        program = str(Path(__file__).with_name("fmu_program.py"))
        self._peer, theirs = socket.socketpair()
        self._limit(_START_LIMIT_S)
        try:
            self._extract()
            self.process = FirmwareProcess(
                name,
                [sys.executable, "-I", "-u", program, str(theirs.fileno()), json.dumps(asked)],
                folder,
                program=interface.file.name,
                inherited=[theirs.fileno()],
            )
        except BaseException:
            self._peer.close()
            self._remove()
            raise
        finally:
            theirs.close()

    def _extract(self) -> None:
        self._remove()
        try:
            with ZipFile(self.interface.file) as archive:
                archive.extractall(self._extracted)
        except OSError as error:
            raise FirmwareError(f"{self.interface.file} cannot be extracted: {error}") from error

    def _remove(self) -> None:
        shutil.rmtree(self._extracted, ignore_errors=True)

    def exchange(self, inputs: Sequence[float]) -> tuple[float, ...]:
        """Give the inputs of a step and return the outputs at its end; the first time those of the start.

        Raises:
            FirmwareError: It has ended, does not answer, or answers that it cannot.
        """
        try:
            self._peer.sendall(self._inputs.pack(*inputs))
            octets = self._peer.recv(self._outputs.size, socket.MSG_WAITALL)
        except BlockingIOError:
            raise self.process.error("does not answer") from None
        except OSError:
            octets = b""
        if len(octets) == self._outputs.size:
            length, *outputs = self._outputs.unpack(octets)
            if not length:
                if not self._initialised:
                    self._initialised = True
                    self._limit(_ANSWER_LIMIT_S)
                return tuple(outputs)
        if not octets:
            raise self.process.parting("has closed its connection")
        with suppress(OSError):  # it is gone after its words
            while more := self._peer.recv(4096):
                octets += more
        words = self.process.last_words()
        raise FirmwareError(
            f"{self.process.name}: {self.process.program} {octets[4:].decode(errors='replace')}"
            f"{f'; its last words: {words}' if words else ''}"
        )

    def _limit(self, seconds: int) -> None:
        """Let each wait for an answer end after *seconds*; in the kernel, which saves calls at each step."""
        limit = struct.pack("ll", seconds, 0)
        self._peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)

    def close(self) -> None:
        """Let it free what it has, end it, and remove its extracted files."""
        self._peer.close()
        self.process.end()
        self._remove()
