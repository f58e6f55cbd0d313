"""Programs in the place of firmwares: how they are started, whether they have something to do."""

from __future__ import annotations

import fcntl
import os
import select
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from volery.simulation.real_firmware.firmware_process import FirmwareProcess

LIMIT_S = 20.0
SLEEP, SPIN = ["/bin/sleep", "60"], ["/bin/sh", "-c", "while :; do :; done"]
SCRIPT = ["/bin/sh", "-c", "sh -c 'while :; do :; done' & exec sleep 60"]


def all_end(session: int) -> bool:
    """Wait for the processes of a session; return whether all end, as those that were killed do soon."""
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            _, _, number, *_ = (process / "stat").read_text().rpartition(")")[2].split()[1:]
            if int(number) == session:
                handle = os.pidfd_open(int(process.name))
                ends, _, _ = select.select([handle], (), (), LIMIT_S)
                os.close(handle)
                if not ends:
                    return False
    return True


@pytest.fixture
def started(tmp_path: Path) -> Any:
    """Start a program; all are ended with the test."""
    processes: list[FirmwareProcess] = []

    def start(command: list[str], **how: Any) -> FirmwareProcess:
        folder = tmp_path / str(len(processes))
        processes.append(FirmwareProcess("drone_1", command, folder, sockets=(), **how))
        return processes[-1]

    yield start
    for process in processes:
        process.end()


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("volery.simulation.real_firmware.firmware_process._REST_LIMIT_S", 0.1)


def test_program_that_sleeps_is_at_rest(started: Any) -> None:
    process = started(SLEEP)
    assert process.rest(started=True)
    assert process.rest(started=False)


@pytest.mark.usefixtures("impatient")
def test_program_that_computes_is_not_at_rest(started: Any) -> None:
    assert not started(SPIN).rest(started=True)


@pytest.mark.usefixtures("impatient")
def test_program_that_its_script_runs_counts_until_it_has_started(started: Any) -> None:
    process = started(SCRIPT)
    assert not process.rest(started=False)
    assert process.rest(started=True)
    process.end()
    assert all_end(process.pid)


def test_program_that_has_ended_is_at_rest(started: Any) -> None:
    process = started(SLEEP)
    process.end()
    assert process.rest(started=True)


def test_lines_that_repeat_are_counted_on_the_console(started: Any) -> None:
    process = started(["/bin/sh", "-c", "echo ready; for i in 1 2 3; do echo I wait; done; exec sleep 60"])
    assert process.rest(started=True)
    assert process.last_words() == "ready · I wait (3 times)"
    process.end()
    assert process.console.read_text() == "ready\nI wait (3 times)\n"


def test_instance_whose_file_is_locked_is_passed_over(started: Any, tmp_path: Path) -> None:
    lock = str(tmp_path / "lock-{instance}")
    with (tmp_path / "lock-1").open("w") as taken:
        fcntl.lockf(taken, fcntl.LOCK_EX)  # as a firmware that runs beside
        instances = [started(SLEEP, lock=lock).instance for _ in range(3)]
    assert instances == [0, 2, 3]


def test_instance_number_is_free_again_once_it_has_ended(started: Any, tmp_path: Path) -> None:
    lock = str(tmp_path / "lock-{instance}")
    first = started(SLEEP, lock=lock)
    first.end()
    assert started(SLEEP, lock=lock).instance == first.instance == 0


def test_core_is_taken_modulo_their_number(started: Any) -> None:
    cores = sorted(os.sched_getaffinity(0))
    for core in (0, 1, 1_000_003):
        assert os.sched_getaffinity(started(SLEEP, core=core).pid) == {cores[core % len(cores)]}
    assert os.sched_getaffinity(started(SLEEP).pid) == set(cores)


def test_files_of_its_threads_are_closed(started: Any) -> None:
    before = len([*Path("/proc/self/fd").iterdir()])
    for _ in range(3):
        process = started(SLEEP)
        assert process.rest(started=True)
        process.end()
    assert len([*Path("/proc/self/fd").iterdir()]) == before
