"""What ground stations and client libraries request of a PX4 beside flying: no request waits for ever."""

from __future__ import annotations

from math import dist, nan
from typing import Any

import pytest

from rigs.station import TARGET

ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
NAK, NOT_FOUND = 129, 10
CALIBRATE, FOLLOW_MODE = 241, (4, 8)


def test_files_logs_and_shell_are_answered(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.send("FILE_TRANSFER_PROTOCOL", **TARGET, payload=[1, 0, 0, 4, 5, 0, 0, 0, 0, 0, 0, 0, *b"a.txt"])
    rig.send("LOG_REQUEST_LIST", **TARGET, start=0, end=65535)
    typed = b"top\nls /\n"
    data = [*typed, *([0] * (70 - len(typed)))]
    rig.send("SERIAL_CONTROL", device=10, flags=2, timeout=0, baudrate=0, count=len(typed), data=data)
    rig.run(0.05)
    payload = rig.latest["FILE_TRANSFER_PROTOCOL"]["payload"]
    assert (payload[0], payload[3], payload[5], payload[12]) == (2, NAK, 4, NOT_FOUND)
    assert rig.latest["LOG_ENTRY"]["num_logs"] == 0
    pieces = [one.fields for one in rig.of("SERIAL_CONTROL")]
    said = b"".join(bytes(one["data"][: one["count"]]) for one in pieces)
    assert said == b"nsh: top: command not found\nnsh: ls: command not found\nnsh> "
    assert all(len(one["data"]) == 70 for one in pieces)


def test_other_serial_devices_do_not_exist(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.send("SERIAL_CONTROL", device=2, flags=2, timeout=0, baudrate=0, count=1, data=[10] * 70)
    rig.run(0.05)
    assert not rig.of("SERIAL_CONTROL")


def test_a_message_that_is_not_sent_now_is_denied_on_request(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert rig.command(512, 360) == DENIED  # ORBIT_EXECUTION_STATUS, while it does not circle
    assert rig.command(512, 30) == ACCEPTED


@pytest.mark.parametrize(
    ("sensor", "asked", "seconds", "last"),
    [
        ("gyro", (1,), 5.0, "done: gyro"),
        ("level", (0, 0, 0, 0, 2), 5.0, "done: level"),
        ("accel", (0, 0, 0, 0, 1), 100.0, "failed: timeout: no motion"),
    ],
)
def test_a_calibration_ends(
    sensor: str, asked: tuple[float, ...], seconds: float, last: str, bench: Any
) -> None:
    rig = bench()
    rig.run(0.5)
    assert rig.command(CALIBRATE, *asked) == ACCEPTED
    rig.run(0.2)
    assert rig.texts()[-1].startswith((f"[cal] calibration started: 2 {sensor}", "[cal] progress <0>"))
    rig.run(seconds)
    assert rig.texts()[-1] == f"[cal] calibration {last}\t"


def test_a_calibration_is_cancelled_and_refused_in_the_air(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert rig.command(CALIBRATE, 1) == ACCEPTED
    rig.run(1.0)
    assert rig.command(CALIBRATE) == ACCEPTED
    rig.run(6.0)
    assert rig.texts()[-1] == "[cal] calibration cancelled\t"
    assert rig.command(CALIBRATE, 9) == DENIED
    assert rig.command(209, 1) == UNSUPPORTED  # moves nothing here
    rig.airborne()
    assert rig.command(CALIBRATE, 1) == REJECTED


def test_it_follows_a_target_at_the_distance_and_height_of_its_parameters(bench: Any) -> None:
    rig = bench()
    rig.airborne(4.0)
    latitude, longitude, _ = rig.vehicle.estimate.geodetic
    start = rig.ned
    assert rig.mode(*FOLLOW_MODE) == ACCEPTED
    rig.run(3.0)
    assert dist(start[:2], rig.ned[:2]) < 1.0  # without a target it holds
    for second in range(40):
        metres = float(min(second, 20))
        rig.send(
            "FOLLOW_TARGET",
            est_capabilities=3,
            lat=round((latitude + metres / 111_320.0) * 1e7),
            lon=round(longitude * 1e7),
            vel=[1.0 if metres < 20 else 0.0, 0.0, 0.0],
        )
        rig.run(1.0)
    assert rig.ned[0] - start[0] == pytest.approx(20.0 - 8.0, abs=1.0)  # FLW_TGT_DST behind its course
    assert rig.ned[1] - start[1] == pytest.approx(0.0, abs=1.0)
    assert rig.height == pytest.approx(8.0, abs=0.5)  # FLW_TGT_HT
    assert rig.vehicle.estimate.attitude[2] == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("wrong", [{"lat": 2_000_000_000}, {"est_capabilities": 0}, {"vel": [nan] * 3}])
def test_a_target_that_is_none_moves_nothing_far(wrong: dict[str, Any], bench: Any) -> None:
    rig = bench()
    rig.airborne(4.0)
    start = rig.ned
    latitude, longitude, _ = rig.vehicle.estimate.geodetic
    assert rig.mode(*FOLLOW_MODE) == ACCEPTED
    target = {
        "est_capabilities": 1,
        "lat": round(latitude * 1e7),
        "lon": round(longitude * 1e7),
        "vel": [0] * 3,
    }
    for _ in range(8):
        rig.send("FOLLOW_TARGET", **{**target, **wrong})
        rig.run(1.0)
    assert dist(start[:2], rig.ned[:2]) < 9.0
