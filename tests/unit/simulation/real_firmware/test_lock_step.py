"""A vehicle in lock step with a recorded ArduPilot, which ends if it is answered by other bytes."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rigs.flown_firmware import FlownFirmware
from rigs.recorded_firmware import stand_in
from volery.base.time import S
from volery.simulation.real_firmware.firmware_process import FirmwareError
from volery.simulation.world.body_specs import Multirotor

RECORDING = Path(__file__).parents[3] / "golden" / "firmware" / "arducopter-4.6.3.json.gz"


def flown(folder: Path, mode: str = "play") -> FlownFirmware:
    return FlownFirmware("ardupilot", stand_in(folder, RECORDING, mode), folder / "firmware")


def is_running(pid: int) -> bool:
    return Path("/proc", str(pid)).exists()


def test_the_recorded_firmware_is_answered_byte_by_byte_and_takes_off(tmp_path: Path) -> None:
    with flown(tmp_path) as one:
        drone = one.open()
        with one.as_script():
            drone.wait_ready()
            drone.takeoff(5.0)
        state = one.autopilot.state()
        assert state.armed
        assert state.mode == "GUIDED"
        assert abs(state.z - 5.0) < 0.5
        assert abs(state.estimated_z - state.z) < 1.0
        pid = one.autopilot.process.pid
    assert not is_running(pid)
    assert (tmp_path / "firmware" / "drone_1" / "console.txt").read_text() == "a recorded firmware\n"


def test_copies_of_a_question_are_answered_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("volery.simulation.real_firmware.lock_step.WARM_UP_LIMIT", 2 * S)
    with flown(tmp_path, "repeat") as one, pytest.raises(FirmwareError, match="does not get ready to arm"):
        one.open()  # and not: the answers differ, which the recording checks


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        ("die", r"drone_1: arducopter-die ended with exit code 3; its last words: .* run out of frames"),
        ("foreign", r"drone_1: arducopter-foreign sends packets of another kind \(4711\)"),
    ],
)
def test_a_firmware_that_fails_is_named_with_its_last_words(tmp_path: Path, mode: str, words: str) -> None:
    with flown(tmp_path, mode) as one, pytest.raises(FirmwareError, match=words):
        one.open()


def test_a_folder_may_have_any_name(tmp_path: Path) -> None:
    folder = tmp_path / "a, b and 'c'"
    folder.mkdir()
    with flown(folder) as one:
        command = Path("/proc", str(one.autopilot.process.pid), "cmdline").read_bytes()
        assert b"\0--defaults=parameters.parm\0" in command
        assert (folder / "firmware" / "drone_1" / "parameters.parm").is_file()


def test_a_firmware_that_hangs_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("volery.simulation.real_firmware.ardupilot.ANSWER_LIMIT_S", 1.0)
    with flown(tmp_path, "hang") as one, pytest.raises(FirmwareError, match="has not answered for 1 s"):
        one.open()
    assert not is_running(one.autopilot.process.pid)


def test_a_firmware_that_dies_in_flight_ends_the_wait_of_its_program(tmp_path: Path) -> None:
    with flown(tmp_path) as one:
        one.autopilot.start(warm=False)
        os.kill(one.autopilot.process.pid, 9)
        with one.as_script(), pytest.raises(FirmwareError, match="was ended by SIGKILL"):
            one.kernel.sleep_until(1 * S)
        assert one.autopilot.state().armed is False


def test_other_bytes_end_the_recorded_firmware(tmp_path: Path) -> None:
    program = stand_in(tmp_path, RECORDING)
    with (
        FlownFirmware("ardupilot", program, tmp_path, spec=Multirotor(heading_deg=30.0)) as one,
        pytest.raises(FirmwareError, match="the answers to frames 0 to 99 differ"),
    ):
        one.open()


def test_two_firmwares_without_networks_of_their_own_have_other_ports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("volery.simulation.real_firmware.firmware_process.ISOLATE", False)
    (tmp_path / "other").mkdir()
    with flown(tmp_path, "die") as first, flown(tmp_path / "other", "die") as second:
        assert not first.autopilot.process.isolated
        assert second.autopilot.process.instance > first.autopilot.process.instance
        with pytest.raises(FirmwareError, match="run out of frames"):
            second.open()
