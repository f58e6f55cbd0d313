"""PX4's simulator link: its bytes against pymavlink's encoder and decoder, and a recorded PX4 behind it."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from rigs.flown_firmware import FlownFirmware
from rigs.recorded_px4 import ABSENT, stand_in
from volery.base.errors import UsageError
from volery.base.time import S
from volery.links.mavlink_codec import MAVLINK
from volery.simulation.real_firmware.firmware_process import FirmwareError
from volery.simulation.real_firmware.px4 import (
    GPS,
    RANGE,
    SENSOR,
    TRANSMITTER,
    ControlsReader,
    Outgoing,
    Px4GroundConnection,
    airframe_parameters,
    rate_gains,
    write_start_scripts,
)
from volery.simulation.world.body_specs import FRAMES, Multirotor, WheeledRover, frame_rotors

RECORDING = Path(__file__).parents[3] / "golden" / "firmware" / "px4-1.17.0.json.gz"
BATTERY = Outgoing("BATTERY_STATUS", "iihHHHHHHHHHHhBBBb", (3, 180))


def decoded(octets: bytes) -> Any:
    """The one message that an independent decoder finds."""
    messages = dialect.MAVLink(None).parse_buffer(octets)
    (message,) = messages
    return message


def encoded(message: Any, system: int = 1) -> bytes:
    return bytes(message.pack(dialect.MAVLink(None, srcSystem=system, srcComponent=1)))


def controls(time: int, *values: float, flags: int = 1, mode: int = 129) -> bytes:
    padded = [*values, *(0.0,) * (16 - len(values))]
    return encoded(dialect.MAVLink_hil_actuator_controls_message(time, padded, mode, flags))


def test_samples_are_read_by_pymavlink() -> None:
    accel, gyro, mag = (0.5, -0.25, -9.75), (0.125, -0.5, 0.0625), (0.25, 0.03125, 0.5)
    message = decoded(SENSOR.pack(1_004_000, *accel, *gyro, *mag, 912.5, 0.0, 0.0, 9.25, 0x1BFF, 0))
    assert message.get_type() == "HIL_SENSOR"
    assert message.time_usec == 1_004_000
    assert (message.xacc, message.yacc, message.zacc) == accel
    assert (message.xgyro, message.ygyro, message.zgyro) == gyro
    assert (message.xmag, message.ymag, message.zmag) == mag
    assert (message.abs_pressure, message.temperature) == (912.5, 9.25)
    assert (message.fields_updated, message.id) == (0x1BFF, 0)


def test_fix_is_read_by_pymavlink() -> None:
    message = decoded(
        GPS.pack(17, 460_825_000, -1_038_995_000, 900_120, 30, 45, 500, 300, -400, 12, 65_535, 3, 10, 0, 0)
    )
    assert (message.lat, message.lon, message.alt) == (460_825_000, -1_038_995_000, 900_120)
    assert (message.eph, message.epv, message.cog) == (30, 45, 65_535)
    assert (message.vel, message.vn, message.ve, message.vd) == (500, 300, -400, 12)
    assert (message.fix_type, message.satellites_visible, message.id) == (3, 10, 0)


def test_transmitter_is_read_by_pymavlink() -> None:
    channels = [1000 + at for at in range(16)]
    message = decoded(TRANSMITTER.pack(1004, *channels, 65_535, 65_535, 16, 100))
    assert [getattr(message, f"chan{at}_raw") for at in range(1, 17)] == channels
    assert (message.chan17_raw, message.chancount, message.rssi) == (65_535, 16, 100)


def test_range_is_read_by_pymavlink() -> None:
    message = decoded(RANGE.pack(1004, 1, 3000, 123, 0, 0, 25, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0))
    assert (message.min_distance, message.max_distance, message.current_distance) == (1, 3000, 123)
    assert message.orientation == dialect.MAV_SENSOR_ROTATION_PITCH_270


def test_battery_is_read_by_pymavlink() -> None:
    cells = (4150, 4150, 4150, *(65_535,) * 7)
    message = decoded(BATTERY.pack(250, -1, 2500, *cells, 2800, 0, 0, 0, 92))
    assert (message.get_srcSystem(), message.get_srcComponent()) == (3, dialect.MAV_COMP_ID_BATTERY)
    assert tuple(message.voltages) == cells
    assert (message.current_consumed, message.current_battery, message.battery_remaining) == (250, 2800, 92)


def test_commands_are_found_between_other_messages_however_the_stream_is_cut() -> None:
    stream = (
        encoded(dialect.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3))
        + controls(1_004_000, 0.1, 0.2, 0.3, 0.4)
        + encoded(dialect.MAVLink_command_long_message(0, 0, 511, 0, 115.0, 5000.0, 0, 0, 0, 0, 0))
        + controls(1_008_000, 0.5, mode=1)
    )
    for size in (1, 7, 60, len(stream)):
        reader = ControlsReader()
        found = []
        for start in range(0, len(stream), size):
            found += reader.feed(stream[start : start + size])
        assert [each.time for each in found] == [1_004_000, 1_008_000]
        assert found[0].values[:5] == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.0])
        assert all(each.lock_step for each in found)


def test_firmware_that_does_not_wait_is_noticed() -> None:
    (found,) = ControlsReader().feed(controls(1_004_000, flags=0))
    assert not found.lock_step


@pytest.mark.parametrize(
    ("stream", "problem"),
    [
        (b"220 ready\r\n" * 2, "octet 0x32 where a frame should begin"),
        (controls(4000, 0.5)[:-2] + b"\0\0", "wrong checksum"),
    ],
)
def test_other_stream_is_refused(stream: bytes, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        ControlsReader().feed(stream)


@pytest.fixture
def wire() -> Iterator[tuple[Px4GroundConnection, socket.socket]]:
    """A telemetry port, and the firmware's end of it."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as theirs,
    ):
        for end in (ours, theirs):
            end.bind(("127.0.0.1", 0))
        theirs.connect(ours.getsockname())
        theirs.settimeout(10.0)
        yield Px4GroundConnection(ours, theirs.getsockname(), lambda: True), theirs


HEARTBEAT = encoded(dialect.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3))


def test_command_waits_until_it_has_been_read(wire: tuple[Px4GroundConnection, socket.socket]) -> None:
    connection, firmware = wire
    connection.write(b"too early")
    assert firmware.recv(4096) == b"too early"
    firmware.send(HEARTBEAT)
    assert connection.read() == HEARTBEAT
    firmware.send(encoded(dialect.MAVLink_ping_message(0, 1, 250, 1)))
    firmware.send(HEARTBEAT)
    connection.write(b"command")
    assert firmware.recv(4096) == b"command"
    ping = decoded(firmware.recv(4096))
    assert (ping.get_type(), ping.seq, ping.target_system) == ("PING", 1, 0)
    assert connection.read() == HEARTBEAT  # without the answer


def test_answers_to_pings_of_others_are_passed_on(wire: tuple[Px4GroundConnection, socket.socket]) -> None:
    connection, firmware = wire
    answer = encoded(dialect.MAVLink_ping_message(0, 1, 255, 190))
    firmware.send(answer)
    assert connection.read() == answer


@pytest.mark.parametrize("frame", sorted(FRAMES))
def test_airframe_is_that_of_the_body(frame: str) -> None:
    spec = Multirotor(frame=frame, rotors=frame_rotors(frame, 0.3))
    parameters = airframe_parameters(spec)
    rotors = len(spec.rotors)
    assert parameters["CA_ROTOR_COUNT"] == rotors
    assert {parameters[f"PWM_MAIN_FUNC{at + 1}"] for at in range(rotors)} == set(range(101, 101 + rotors))
    for at, rotor in enumerate(spec.rotors):
        assert parameters[f"CA_ROTOR{at}_PX"] == rotor.forward
        assert parameters[f"CA_ROTOR{at}_PY"] == -rotor.left  # right
        assert (parameters[f"CA_ROTOR{at}_KM"] > 0) == (rotor.spin < 0)  # anticlockwise is positive


def test_rate_loops_are_as_fast_on_a_heavier_body() -> None:
    usual = Multirotor()
    heavier = replace(usual, inertia=(0.08, 0.04, 0.089))
    (roll, pitch, yaw), (other_roll, other_pitch, other_yaw) = rate_gains(usual), rate_gains(heavier)
    assert other_roll == pytest.approx(2.0 * roll)
    assert (other_pitch, other_yaw) == (pitch, yaw)
    assert rate_gains(replace(usual, rotor_lag=2.0 * usual.rotor_lag))[0] < roll


def test_start_scripts_get_an_airframe_one_link_and_no_battery(tmp_path: Path) -> None:
    scripts = tmp_path / "program" / "etc" / "init.d-posix"
    (scripts / "airframes").mkdir(parents=True)
    (scripts / "px4-rc.mavlink").write_text("mavlink start -x -u 18570\nmavlink start -x -u 14580\n")
    (scripts / "rcS").write_text(
        ". px4-alias.sh\nload_mon start\n\tbattery_simulator start\ncommander start\n"
    )
    write_start_scripts(tmp_path / "program" / "etc", tmp_path / "folder", {"MAV_SYS_ID": 3})
    copied = tmp_path / "folder" / "etc" / "init.d-posix"
    (airframe,) = (copied / "airframes").iterdir()
    assert "param set MAV_SYS_ID 3\n" in airframe.read_text()
    script = (copied / "rcS").read_text()
    assert script == ". px4-alias.sh\nR=./\nload_mon start\n\t:\ncommander start\n"
    assert (copied / "px4-rc.mavlink").read_text().count("mavlink start") == 1
    assert (scripts / "rcS").read_text().count("battery_simulator") == 1


def test_frames_are_those_of_the_codec() -> None:
    (frame,) = MAVLINK.parser().feed(TRANSMITTER.pack(1, *range(18), 16, 100))
    assert (frame.name, frame.fields["chancount"]) == ("RC_CHANNELS", 16)


def flown(folder: Path, mode: str = "play", **how: Any) -> FlownFirmware:
    return FlownFirmware("px4", stand_in(folder, RECORDING, mode), folder / "firmware", **how)


def test_the_recorded_firmware_is_sent_its_samples_byte_by_byte_and_arms(tmp_path: Path) -> None:
    with flown(tmp_path) as one:
        drone = one.open()
        with one.as_script():
            drone.wait_ready()
            drone.arm()
        state = one.autopilot.state()
        assert state.armed
        assert state.mode == "AUTO.LOITER"
        assert one.commands[0] == (0.0,) * 4
        assert 0.0 < max(one.commands[-1]) < 0.2  # the motors idle
        assert one.autopilot.process.ending() == ""
    assert (tmp_path / "firmware" / "drone_1" / "console.txt").read_text() == "a recorded firmware\n"


def test_other_samples_end_the_recorded_firmware(tmp_path: Path) -> None:
    turned = Multirotor(heading_deg=30.0)
    with (
        flown(tmp_path, spec=turned) as one,
        pytest.raises(FirmwareError, match="samples of exchanges 0 to 99 differ"),
    ):
        one.open()


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        ("die", "drone_1: px4-die ended with exit code 3; its last words: .* it has run out of memory"),
        ("close", "drone_1: px4-close has closed its simulator link; its last words: a recorded firmware"),
        ("free", "drone_1: px4-free was built without lock step; build px4_sitl_default"),
        ("foreign", "drone_1: px4-foreign sends no MAVLink on its simulator link: octet 0x32"),
    ],
)
def test_a_firmware_that_fails_is_named_with_its_last_words(tmp_path: Path, mode: str, words: str) -> None:
    with flown(tmp_path, mode) as one, pytest.raises(FirmwareError, match=words):
        one.open()


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        ("hang", "px4-hang has not answered for 1 s"),
        ("elsewhere", "px4-elsewhere has not connected to its simulator link within 1 s"),
    ],
)
def test_a_firmware_that_hangs_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str, words: str
) -> None:
    monkeypatch.setattr("volery.simulation.real_firmware.px4.ANSWER_LIMIT_S", 1.0)
    with flown(tmp_path, mode) as one, pytest.raises(FirmwareError, match=words):
        one.open()
    assert not Path("/proc", str(one.autopilot.process.pid)).exists()


def test_a_parameter_that_the_firmware_lacks_is_named(tmp_path: Path) -> None:
    with (
        flown(tmp_path, "absent", parameters={"MPC_XY_CRUISE": 4.0, ABSENT: 1.0}) as one,
        pytest.raises(FirmwareError, match=f"drone_1: px4-absent has no parameter {ABSENT}"),
    ):
        one.open()


def test_program_without_start_scripts_is_refused(tmp_path: Path) -> None:
    program = stand_in(tmp_path, RECORDING)
    (tmp_path / "build" / "etc" / "init.d-posix" / "rcS").unlink()
    with pytest.raises(FirmwareError, match="px4-play has no start scripts"):
        FlownFirmware("px4", program, tmp_path / "firmware")


def test_start_scripts_that_cannot_be_copied_are_named_once(tmp_path: Path) -> None:
    program = stand_in(tmp_path, RECORDING)
    for name in ("rc.one", "rc.two"):
        (tmp_path / "build" / "etc" / name).symlink_to("nowhere")
    with pytest.raises(FirmwareError, match=r"scripts cannot be copied: \[Errno 2\] No such .*rc\.\w+'$"):
        FlownFirmware("px4", program, tmp_path / "firmware")


def test_rover_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="drone_1: a real PX4 flies multirotors here"):
        flown(tmp_path, spec=WheeledRover())


def test_a_second_instance_has_another_number(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    with flown(tmp_path, "elsewhere") as first, flown(tmp_path / "other", "elsewhere") as second:
        assert second.autopilot.process.instance > first.autopilot.process.instance


def messages_after(folder: Path, act: Callable[[FlownFirmware], None]) -> list[Any]:
    """What the firmware is sent within a tenth of a second from an act on."""
    sent: list[bytes] = []
    with flown(folder) as one:
        one.open()
        exchange: Any = one.autopilot._exchange
        write = exchange._write
        exchange._write = lambda octets: (sent.append(octets), write(octets))
        act(one)
        with one.as_script():
            one.kernel.sleep_until(one.kernel.now() + S // 10)
    return dialect.MAVLink(None).parse_buffer(b"".join(sent)) or []


def test_the_pilot_reaches_it_over_the_simulator_link(tmp_path: Path) -> None:
    def move(one: FlownFirmware) -> None:
        one.autopilot.transmitter[:] = [1500 + at for at in range(16)]

    heard = [each for each in messages_after(tmp_path, move) if each.get_type() == "RC_CHANNELS"]
    assert {(each.chan1_raw, each.chan16_raw, each.chancount) for each in heard} == {(1500, 1515, 16)}


def test_a_pilot_whose_transmitter_is_lost_does_not_reach_it(tmp_path: Path) -> None:
    def lose(one: FlownFirmware) -> None:
        one.autopilot.transmitter[:] = [1500] * 16
        one.flight.block_transmitter()

    kinds = [each.get_type() for each in messages_after(tmp_path, lose)]
    assert "RC_CHANNELS" not in kinds[10:]  # the fault counts from the next step of the world on
    assert len(kinds) > 20


def test_stuck_sensors_repeat_their_last_sample(tmp_path: Path) -> None:
    def block(one: FlownFirmware) -> None:
        one.flight.block_barometer()
        one.flight.block_compass()

    samples = [each for each in messages_after(tmp_path, block) if each.get_type() == "HIL_SENSOR"]
    fields = [(each.xmag, each.ymag, each.zmag) for each in samples if each.fields_updated & 0x01C0]
    pressures = [each.abs_pressure for each in samples if each.fields_updated & 0x1A00]
    assert min(len(fields), len(pressures)) >= 2
    assert len(set(fields)) == len(set(pressures)) == 1
