"""The world of a model, flown by small programs over ArduPilot's JSON interface."""

from __future__ import annotations

import json
import os
import signal
import socket
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from volery.base.errors import CapabilityError, UsageError
from volery.base.time import S
from volery.model.system import System
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary
from volery.run.result import Options, Run
from volery.run.serve_world import STRIDE, WorldPorts, WorldSession

QUESTION = struct.Struct("<HHI16H")
RESTING, CLIMBING = [1000] * 4, [1700] * 4
VEHICLE = "{kind: multirotor, autopilot: ardupilot, at: pad}"


def model(folder: Path, *names: str) -> System:
    vehicles = ", ".join(f"{name}: {VEHICLE}" for name in names)
    (folder / "model.yaml").write_text(
        "volery: 1\nname: field\nenvironment:\n  origin: {latitude: 46, longitude: 7, amsl: 500 m}\n"
        f"  places: {{pad: {{east: 3 m, north: 0 m}}}}\n  vehicles: {{{vehicles}}}\n"
    )
    return load(folder, vocabulary())


class Program:
    """A program that asks, as a firmware does."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((host, int(port)))
        self.socket.settimeout(20.0)
        self.number = 0
        self.answers: list[dict[str, Any]] = []

    def send(self, pulses: Sequence[int], magic: int = 18_458) -> None:
        self.socket.send(QUESTION.pack(magic, 1200, self.number, *pulses, *[0] * (16 - len(pulses))))

    def ask(self, pulses: Sequence[int], times: int = 1) -> dict[str, Any]:
        for _ in range(times):
            self.send(pulses)
            self.number += 1
            self.answers.append(json.loads(self.socket.recv(4096)))
        return self.answers[-1]


def answered(session: WorldSession, task: Callable[[], object], *, ends: bool = True) -> Run:
    """Run a session while programs ask in a thread, end it after that by a signal, and return its run.

    Without *ends* it is to end by itself, unless the task fails.
    """
    failures: list[BaseException] = []

    def ask_and_end() -> None:
        try:
            task()
        except BaseException as error:
            failures.append(error)
        if session.running and (ends or failures):
            os.kill(os.getpid(), signal.SIGTERM)

    thread = Thread(target=ask_and_end)
    thread.start()
    try:
        run = session.run()
    finally:
        session.leave()
        thread.join()
    if failures:
        raise failures[0]
    return run


def free_port() -> int:
    """Return a UDP port that is free, and so is that of a second vehicle."""
    while True:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
            suppress(OSError, OverflowError),
        ):
            one.bind(("127.0.0.1", 0))
            port: int = one.getsockname()[1]
            other.bind(("127.0.0.1", port + STRIDE))
            return port


def open_session(
    system: System, duration: int | None, said: list[str], out: Path | None = None, **ports: Any
) -> WorldSession:
    chosen = WorldPorts(first=free_port(), **ports)
    return WorldSession(system, Options(fidelity="times", out=out), chosen, duration, said.append)


def test_a_program_flies_in_the_world_of_a_model_which_records_it(tmp_path: Path) -> None:
    said: list[str] = []
    session = open_session(model(tmp_path, "drone_1"), S, said, tmp_path / "run", rate=400.0)
    [served] = session.served
    program = Program(served.address)

    def fly_to_the_end() -> None:
        program.ask(RESTING, 50)
        program.ask(CLIMBING, 340)
        program.socket.settimeout(1.0)
        with suppress(OSError):  # the world has closed its port, or leaves the last question unanswered
            while True:
                program.ask(CLIMBING)

    run = answered(session, fly_to_the_end, ends=False)
    assert run.completed
    assert run.record.outcome.reason == "its time is up"
    times = [answer["timestamp"] for answer in program.answers]
    assert times[0] == 0.0
    assert times[1:4] == pytest.approx([0.0025, 0.005, 0.0075], rel=1e-6)
    assert program.answers[40]["position"] == pytest.approx([0.0, 0.0, 0.0], abs=0.01)  # about its home
    assert program.answers[40]["imu"]["accel_body"][2] == pytest.approx(-9.8, abs=0.3)
    assert program.answers[-1]["position"][2] < -0.2
    assert program.answers[-1]["velocity"][2] < -0.5
    assert said == [f"drone_1: a program at 127.0.0.1:{program.socket.getsockname()[1]} is connected"]
    states = run.arrays("drone_1")
    assert states["x"][0] == pytest.approx(3.0)
    assert not states["armed"][0]
    assert states["armed"][-1]
    assert "FRAME_CLASS 1\n" in (tmp_path / "run" / "drone_1.parm").read_text()
    assert f"--defaults={tmp_path / 'run' / 'drone_1.parm'}" in served.command


def test_time_waits_for_the_program_of_each_vehicle(tmp_path: Path) -> None:
    said: list[str] = []
    session = open_session(model(tmp_path, "drone_1", "drone_2"), None, said, rate=100.0)
    first, second = (Program(one.address) for one in session.served)
    held: list[float] = []

    def ask_until_it_is_held() -> None:
        first.ask(RESTING)
        first.socket.settimeout(0.5)
        try:
            while True:
                first.ask(RESTING)
        except TimeoutError:
            held.append(first.answers[-1]["timestamp"])
        first.socket.settimeout(20.0)
        second.ask(RESTING, 2)
        first.answers.append(json.loads(first.socket.recv(4096)))

    assert answered(session, ask_until_it_is_held).completed
    assert held[0] < 0.015  # the grid of reading
    assert first.answers[-1]["timestamp"] > held[0]


def test_one_vehicle_is_served_and_the_others_keep_their_simulated_autopilots(tmp_path: Path) -> None:
    session = open_session(model(tmp_path, "drone_1", "drone_2"), None, [], only="drone_2", rate=100.0)
    [served] = session.served
    assert served.name == "drone_2"
    program = Program(served.address)
    assert answered(session, lambda: program.ask(RESTING, 10)).completed


def test_a_copy_is_not_answered_and_what_is_no_question_is_told_once(tmp_path: Path) -> None:
    said: list[str] = []
    session = open_session(model(tmp_path, "drone_1"), None, said, rate=100.0)
    program = Program(session.served[0].address)

    def ask() -> None:
        program.socket.send(b"hello")
        program.send(RESTING, magic=4711)
        program.ask(RESTING)
        program.number -= 1
        program.send(RESTING)  # the copy of a question whose answer is on its way
        program.number += 1
        program.ask(RESTING, 9)

    assert answered(session, ask).completed
    assert [answer["timestamp"] for answer in program.answers] == pytest.approx(
        [0.01 * step for step in range(10)], rel=1e-6
    )
    [strange] = [line for line in said if "is not answered" in line]
    assert "packets of 5 octets, too few for a question. A question has 40 or 72 octets" in strange


def test_a_program_that_is_started_again_begins_a_clock_of_its_own(tmp_path: Path) -> None:
    said: list[str] = []
    session = open_session(model(tmp_path, "drone_1"), None, said, rate=100.0)
    first, again = (Program(session.served[0].address) for _ in range(2))
    assert answered(session, lambda: (first.ask(RESTING, 5), again.ask(RESTING, 5))).completed
    assert again.answers[0]["timestamp"] == 0.0
    assert again.answers[-1]["timestamp"] == pytest.approx(0.04, rel=1e-6)
    assert said[-1].endswith("takes the place of the last")


def test_two_programs_at_one_port_end_the_run(tmp_path: Path) -> None:
    session = open_session(model(tmp_path, "drone_1"), S, [], rate=100.0)
    first, second = (Program(session.served[0].address) for _ in range(2))
    run = answered(
        session, lambda: (first.ask(RESTING, 2), second.ask(RESTING, 2), first.send(RESTING)), ends=False
    )
    assert isinstance(run.error, UsageError)
    assert "drone_1: two programs ask at 127.0.0.1" in run.record.outcome.reason
    assert "end one, or start it for another vehicle" in run.record.outcome.reason


def test_a_signal_ends_a_world_that_waits(tmp_path: Path) -> None:
    session = open_session(model(tmp_path, "drone_1"), None, [], rate=100.0)
    program = Program(session.served[0].address)
    run = answered(session, lambda: program.ask(RESTING, 3))
    assert run.completed
    assert run.record.outcome.reason == "SIGTERM received"


def test_a_silent_program_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("volery.simulation.real_firmware.outside_program.SILENCE_LIMIT_S", 0.2)
    said: list[str] = []
    session = open_session(model(tmp_path, "drone_1"), None, said, rate=100.0)
    program = Program(session.served[0].address)

    def ask() -> None:
        program.ask(RESTING, 5)
        program.socket.settimeout(0.7)
        with pytest.raises(TimeoutError):
            program.socket.recv(4096)  # nothing comes unasked
        program.ask(RESTING, 5)

    assert answered(session, ask).completed
    assert said[1:]
    assert all("no question for 0.2 s; the world waits" in line for line in said[1:])


def test_what_cannot_be_served_is_named_with_a_remedy(tmp_path: Path) -> None:
    system = model(tmp_path, "drone_1")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=rf"UDP port {port} of 127.0.0.1 .* give another with --json"):
            WorldSession(system, Options(fidelity="times"), WorldPorts(first=port), S, print)
    with pytest.raises(UsageError, match="no vehicle 'drone_9'; there is drone_1"):
        open_session(system, S, [], only="drone_9")
    with pytest.raises(UsageError, match="a rate of 5 Hz: give 20 to 4000"):
        open_session(system, S, [], rate=5.0)
    with pytest.raises(UsageError, match="field has no vehicle; add one"):
        open_session(model(tmp_path), S, [])


def test_a_fault_of_a_sensor_that_the_program_simulates_is_refused(tmp_path: Path) -> None:
    model(tmp_path, "drone_1")
    with (tmp_path / "model.yaml").open("a") as file:
        file.write("  faults: {trouble: {kind: gps-lost, vehicle: drone_1, at: 1 s}}\n")
    words = "fault trouble: drone_1: a program that others start cannot be given gps-lost; .* SIM_GPS_DISABLE"
    with pytest.raises(CapabilityError, match=words):
        open_session(load(tmp_path, vocabulary()), S, []).run()
