"""An exchange with a real PX4, recorded once, and the program that answers as it did.

The recording holds the commands and the telemetry that the firmware sent, exchange by exchange, and digests
of the samples that it was sent. As a program this file plays the firmware: it ends with an error at the first
exchanges whose samples differ by a byte.

    python tests/rigs/recorded_px4.py record PROGRAM FILE     with a real firmware
    python tests/rigs/recorded_px4.py FILE MODE [OPTIONS]     in the place of a firmware

*MODE* is ``play``, ``absent`` (it lacks a parameter), ``foreign`` (it connects and talks another protocol),
``elsewhere`` (it does not connect), or what happens at exchange 400: ``die``, ``hang``, ``close`` (the link),
``free`` (it does not wait for samples any more).
"""

from __future__ import annotations

import base64
import gzip
import json
import socket
import stat
import struct
import sys
import threading
from hashlib import blake2b
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fastcrc.crc16 import mcrf4xx

DIGEST_EVERY = 100
FAULT_AT = 400
LIMIT_S = 20.0
HIL_SENSOR, HIL_ACTUATOR_CONTROLS, PING = (107, 108), (93, 47), (4, 237)
"""Number of a message, and the extra octet of its checksum."""
ABSENT = "NO_SUCH_PARAM"


def stand_in(folder: Path, recording: Path, mode: str = "play") -> Path:
    """Write a program that plays *recording*, with start scripts beside it, and return its path."""
    program = folder / "build" / "bin" / f"px4-{mode}"
    program.parent.mkdir(parents=True, exist_ok=True)
    (folder / "build" / "etc" / "init.d-posix" / "airframes").mkdir(parents=True, exist_ok=True)
    (folder / "build" / "etc" / "init.d-posix" / "rcS").write_text("battery_simulator start\n")
    here = Path(__file__).resolve()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} {here} {recording.resolve()} {mode} "$@"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return program


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _frame(message: tuple[int, int], payload: bytes) -> bytes:
    number, extra = message
    covered = bytes((len(payload), 0, 0, 0, 1, 1, number, 0, 0)) + payload
    return b"\xfd" + covered + struct.pack("<H", mcrf4xx(covered + bytes([extra])))


def _answer_pings(ground: socket.socket) -> None:
    """Return each PING to its sender, as PX4 does; nothing else of a ground station counts."""
    while True:
        octets, address = ground.recvfrom(4096)
        if octets[7] == PING[0] and not any(octets[8:10]):
            ground.sendto(_frame(PING, octets[10:22] + octets[5:7]), address)


class _Samples:
    """The stream of samples, as pieces that end with HIL_SENSOR."""

    def __init__(self, world: socket.socket) -> None:
        self._world, self._octets = world, b""

    def piece(self) -> tuple[bytes, int]:
        """Return the octets of the next piece, and its time [us]."""
        end = 0
        while True:
            while len(self._octets) - end < 10 or len(self._octets) < end + 12 + self._octets[end + 1]:
                more = self._world.recv(65_536)
                if not more:  # the world has ended
                    sys.exit(0)
                self._octets += more
            start, end = end, end + 12 + self._octets[end + 1]
            if self._octets[start + 7] == HIL_SENSOR[0]:
                piece, self._octets = self._octets[:end], self._octets[end:]
                return piece, struct.unpack_from("<Q", piece, start + 10)[0]


def _connect(port: int, *, foreign: bool) -> socket.socket:
    """Return the simulator link; with *foreign* it carries another protocol."""
    world = socket.create_connection(("127.0.0.1", port))
    world.settimeout(LIMIT_S)
    if foreign:
        world.sendall(b"220 welcome to another service\r\n")
        _outlast(world)
    return world


def _outlast(world: socket.socket) -> None:
    """Wait until the other end closes."""
    world.settimeout(None)
    while world.recv(65_536):
        pass


def _at_fault(mode: str, world: socket.socket) -> int:
    """Do what happens at the exchange of the fault."""
    if mode == "hang":
        threading.Event().wait()
    if mode == "close":
        world.close()
        threading.Event().wait()
    _say("it has run out of memory")
    return 3


def play(recording: Path, mode: str, options: list[str]) -> int:
    """Answer as the recorded firmware did; return the exit code."""
    with gzip.open(recording, "rt", encoding="ascii") as file:
        recorded: dict[str, Any] = json.load(file)
    said = {int(at): base64.b64decode(text) for at, text in recorded["said"].items()}
    values = struct.unpack(f"<{4 * recorded['exchanges']}f", base64.b64decode(recorded["commands"]))
    instance = int(options[options.index("-i") + 1])
    _say("a recorded firmware")
    if mode == "elsewhere":
        threading.Event().wait()
    world = _connect(4560 + instance, foreign=mode == "foreign")
    if mode == "absent":
        _say(f"ERROR [param] Parameter {ABSENT} not found.")
    ground = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ground.bind(("127.0.0.1", 14_580 + instance))
    threading.Thread(target=_answer_pings, args=(ground,), daemon=True).start()
    samples = _Samples(world)
    digest = blake2b(digest_size=6)
    for at in range(recorded["exchanges"]):
        piece, time = samples.piece()
        digest.update(piece)
        if at % DIGEST_EVERY == DIGEST_EVERY - 1:
            if digest.hexdigest() != recorded["digests"][at // DIGEST_EVERY]:
                _say(f"the samples of exchanges {at - DIGEST_EVERY + 1} to {at} differ")
                return 4
            digest = blake2b(digest_size=6)
        if at == FAULT_AT and mode in ("die", "hang", "close"):
            return _at_fault(mode, world)
        if at in said:
            ground.sendto(said[at], ("127.0.0.1", 14_540 + instance))
        waits = not (mode == "free" and at >= FAULT_AT)
        controls = *values[4 * at : 4 * at + 4], *(0.0,) * 12
        world.sendall(_frame(HIL_ACTUATOR_CONTROLS, struct.pack("<QQ16fB", time, waits, *controls, 129)))
    _say("the recording has ended")
    _outlast(world)
    return 0


def record(program: Path, recording: Path) -> None:
    """Warm a PX4 up, arm it, and record all that passes."""
    from rigs.flown_firmware import FlownFirmware  # the program imports nothing of volery

    commands = bytearray()
    digests: list[str] = []
    said: dict[int, bytes] = {}
    pieces: list[bytes] = []
    with TemporaryDirectory() as folder, FlownFirmware("px4", program, Path(folder)) as flown:
        exchange: Any = flown.autopilot._exchange
        ground: Any = flown.autopilot._ground
        write, receive, read = exchange._write, exchange.receive, ground._connection.read

        def note_samples(octets: bytes) -> None:
            pieces.append(octets)
            if len(pieces) % DIGEST_EVERY == 0:
                group = b"".join(pieces[-DIGEST_EVERY:])
                digests.append(blake2b(group, digest_size=6).hexdigest())
            write(octets)

        def note_commands() -> Any:
            answer = receive()
            commands.extend(struct.pack("<4f", *answer))
            return answer

        def note_said() -> bytes:
            octets: bytes = read()
            if octets:
                at = len(pieces) - 1
                said[at] = said.get(at, b"") + octets
            return octets

        exchange._write, exchange.receive, ground._connection.read = note_samples, note_commands, note_said
        drone = flown.open()
        with flown.as_script():
            drone.wait_ready()
            drone.arm()
            flown.kernel.sleep_until(flown.kernel.now() + 500_000_000)  # beyond what is read of it afterwards
    whole = {
        "exchanges": len(commands) // 16,
        "commands": base64.b64encode(commands).decode("ascii"),
        "said": {at: base64.b64encode(octets).decode("ascii") for at, octets in said.items()},
        "digests": digests,
    }
    with gzip.GzipFile(recording, "wb", mtime=0) as file:
        file.write(json.dumps(whole).encode("ascii"))


if __name__ == "__main__":
    if sys.argv[1] == "record":
        record(Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        sys.exit(play(Path(sys.argv[1]), sys.argv[2], sys.argv[3:]))
