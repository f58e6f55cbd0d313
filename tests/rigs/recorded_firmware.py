"""An exchange with a real ArduPilot, recorded once, and the program that answers as it did.

The recording holds what the firmware sent, frame by frame, and digests of what it was sent. As a program this
file plays the firmware: it ends with an error at the first frames whose answers differ by a byte.

    python tests/rigs/recorded_firmware.py record PROGRAM FILE     with a real firmware
    python tests/rigs/recorded_firmware.py FILE MODE [OPTIONS]     in the place of a firmware

*MODE* is ``play``, or what happens at frame 400: ``die``, ``hang``, ``repeat`` (each question thrice),
``foreign`` (a packet of another kind).
"""

from __future__ import annotations

import gzip
import json
import socket
import stat
import struct
import sys
import threading
from hashlib import blake2b
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

QUESTION = struct.Struct("<HHI16H")
DIGEST_EVERY = 100
FAULT_AT = 400
LIMIT_S = 20.0


def stand_in(folder: Path, recording: Path, mode: str = "play") -> Path:
    """Write a program that plays *recording* and return its path."""
    program = folder / f"arducopter-{mode}"
    here = Path(__file__).resolve()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} {here} {recording.resolve()} {mode} "$@"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return program


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _digests(answers: list[bytes]) -> list[str]:
    groups = [answers[at : at + DIGEST_EVERY] for at in range(0, len(answers), DIGEST_EVERY)]
    return [blake2b(b"".join(group), digest_size=6).hexdigest() for group in groups]


def play(recording: Path, mode: str, options: list[str]) -> int:
    """Answer as the recorded firmware did; return the exit code."""
    with gzip.open(recording, "rt", encoding="ascii") as file:
        recorded: dict[str, Any] = json.load(file)
    pulses = [group for count, group in recorded["pulses"] for _ in range(count)]
    said = {int(frame): bytes.fromhex(text) for frame, text in recorded["said"].items()}
    (serial,) = [option for option in options if option.startswith("--serial0=")]
    instance = next(int(option[2:]) for option in options if option.startswith("-I"))
    ground = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ground.connect(("127.0.0.1", int(serial.rpartition(":")[2])))
    world = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    world.settimeout(LIMIT_S)
    to = "127.0.0.1", 9002 + 10 * instance
    _say("a recorded firmware")
    answers: list[bytes] = []
    for frame, group in enumerate(pulses):
        if frame in said:
            ground.send(said[frame])
        question = QUESTION.pack(18_458, 1200, frame, *group)
        if frame == FAULT_AT and mode == "die":
            _say("it has run out of frames")
            return 3
        if frame == FAULT_AT and mode == "hang":
            threading.Event().wait()
        if frame == FAULT_AT and mode == "foreign":
            question = QUESTION.pack(4711, 1200, frame, *group)
        for _ in range(3 if mode == "repeat" and frame >= FAULT_AT else 1):
            world.sendto(question, to)
        answers.append(world.recv(65_536))
        if len(answers) == DIGEST_EVERY:
            [digest] = _digests(answers)
            if digest != recorded["digests"][frame // DIGEST_EVERY]:
                _say(f"the answers to frames {frame - DIGEST_EVERY + 1} to {frame} differ")
                return 4
            answers.clear()
    _say("the recording has ended")
    world.settimeout(None)
    world.recv(65_536)
    return 0


def record(program: Path, recording: Path) -> None:
    """Warm an ArduCopter up, take off, and record all that passes."""
    from rigs.flown_firmware import FlownFirmware  # the program imports nothing of volery

    pulses: list[tuple[int, ...]] = []
    answers: list[bytes] = []
    said: dict[int, bytes] = {}
    with TemporaryDirectory() as folder, FlownFirmware("ardupilot", program, Path(folder)) as flown:
        flown.watch(pulses, answers, said)
        drone = flown.open()
        with flown.as_script():
            drone.wait_ready()
            drone.takeoff(5.0)
            flown.kernel.sleep_until(flown.kernel.now() + 100_000_000)  # beyond what is read of it afterwards
    runs = [(len([*group]), list(key)) for key, group in groupby(pulses)]
    whole = {
        "pulses": runs,
        "said": {frame: octets.hex() for frame, octets in said.items()},
        "digests": _digests(answers),
    }
    with gzip.GzipFile(recording, "wb", mtime=0) as file:
        file.write(json.dumps(whole).encode("ascii"))


if __name__ == "__main__":
    if sys.argv[1] == "record":
        record(Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        sys.exit(play(Path(sys.argv[1]), sys.argv[2], sys.argv[3:]))
