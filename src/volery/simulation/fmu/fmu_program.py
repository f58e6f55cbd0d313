"""Program that loads an FMU and steps it for its parent, so that a crash of machine code is not the parent's.

It is started as a script and imports nothing of volery. Usage: ``fmu_program.py DESCRIPTOR JSON``.
``DESCRIPTOR`` is a Unix socket to the parent. ``JSON`` has the ``folder`` of the extracted FMU, its
``identifier``, ``token`` (guid) and FMI ``version`` (2 or 3), the ``step`` in seconds, ``parameters`` as
[type, value reference, value], and of ``inputs`` and ``outputs`` each the value references and the number of
values.

A request is the inputs, as doubles. The answer is an int32: 0, and the outputs as doubles follow, or the
length of the text of an error, which follows; the program then ends. The first request initialises the FMU,
each further one makes a step. The end of the connection ends the simulation and frees the FMU; the folder is
removed, also if the program or its parent is killed.
"""

import contextlib
import json
import os
import shutil
import signal
import socket
import struct
import sys
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

_FATAL = 4


class _EndedError(Exception):
    """The FMU ends the simulation by itself."""


class _Fmi2:
    def __init__(self, asked: dict[str, Any]) -> None:
        self.slave = FMU2Slave(
            guid=asked["token"],
            unzipDirectory=asked["folder"],
            modelIdentifier=asked["identifier"],
        )
        self.slave.instantiate()
        setters = {"Integer": self.slave.setInteger, "Boolean": self.slave.setBoolean}
        for kind, reference, value in asked["parameters"]:
            setters.get(kind, self.slave.setReal)([reference], [value])
        self.set, self._outputs = self.slave.setReal, asked["outputs"][0]
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()

    def begin(self) -> None:
        self.slave.exitInitializationMode()

    def step(self, time: float, step: float) -> None:
        self.slave.doStep(time, step)

    def get(self) -> list[float]:
        return list(self.slave.getReal(self._outputs))


class _Fmi3:
    def __init__(self, asked: dict[str, Any]) -> None:
        self.slave = FMU3Slave(
            guid=asked["token"],
            unzipDirectory=asked["folder"],
            modelIdentifier=asked["identifier"],
        )
        self.slave.instantiate()
        for kind, reference, value in asked["parameters"]:
            getattr(self.slave, f"set{kind}")([reference], [value])
        self.set, (self._outputs, self._count) = self.slave.setFloat64, asked["outputs"]
        self.slave.enterInitializationMode(startTime=0.0)

    def begin(self) -> None:
        self.slave.exitInitializationMode()

    def step(self, time: float, step: float) -> None:
        _, ended, early, reached = self.slave.doStep(time, step)
        if ended:
            raise _EndedError("asks to end the simulation")
        if early:
            raise _EndedError(f"returns early, at {reached:g} s")

    def get(self) -> list[float]:
        return list(self.slave.getFloat64(self._outputs, self._count))


def _read(link: socket.socket, size: int) -> bytes:
    """Return a request; empty: the parent has ended the simulation."""
    octets = link.recv(size, socket.MSG_WAITALL)
    return octets if len(octets) == size else b""


def _serve(link: socket.socket, fmu: _Fmi2 | _Fmi3, asked: dict[str, Any], first: bytes) -> None:
    references, count = asked["inputs"]
    inputs, answer = struct.Struct(f"{count}d"), struct.Struct(f"=i{asked['outputs'][1]}d")
    step, steps = asked["step"], 0
    fmu.set(references, inputs.unpack(first))
    fmu.begin()
    link.sendall(answer.pack(0, *fmu.get()))
    while octets := _read(link, inputs.size):
        fmu.set(references, inputs.unpack(octets))
        fmu.step(steps * step, step)
        steps += 1
        link.sendall(answer.pack(0, *fmu.get()))


def _remove_at_end(folder: str, link: socket.socket) -> None:
    """Let another process, without *link*, remove *folder* when this one is gone, however it ends."""
    reading, writing = os.pipe()
    if os.fork():
        os.close(reading)
        return
    os.close(writing)
    link.close()
    os.read(reading, 1)  # returns once the other end is closed, by the end of this process
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


def _what(error: Exception) -> str:
    if isinstance(error, FMICallException):
        status = {2: "discard", 3: "error", 4: "fatal"}.get(error.status, str(error.status))
        return f"answers {error.function} with status {status}"
    return str(error) if isinstance(error, _EndedError) else f"cannot be loaded: {error}"


def main() -> None:
    """Step the FMU until the connection ends."""
    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, signal.SIG_IGN)  # the end of the connection ends it, in order
    asked = json.loads(sys.argv[2])
    with socket.socket(fileno=int(sys.argv[1])) as link:
        _remove_at_end(asked["folder"], link)
        fmu = None
        usable = True
        first = _read(link, 8 * asked["inputs"][1])
        if not first:
            return
        try:
            fmu = _Fmi2(asked) if asked["version"] == 2 else _Fmi3(asked)
            _serve(link, fmu, asked, first)
            fmu.slave.terminate()
        except Exception as error:  # machine code of others, and what wraps it
            usable = getattr(error, "status", 0) != _FATAL
            text = _what(error).encode()
            with contextlib.suppress(OSError):
                link.sendall(struct.pack("=i", len(text)) + text)
        if fmu is not None and usable:
            fmu.slave.freeInstance()


if __name__ == "__main__":
    main()
