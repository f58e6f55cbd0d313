"""``examples/serial_imu``: a reader publishes what the sensor at the other end of the port measured."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from volery import Options, simulate
from volery.model.system_loader import load
from volery.ros.messages import from_cdr
from volery.run.assembly.model_checks import vocabulary
from volery.trace.events import Published
from volery.trace.reader import read

EXAMPLE = Path(__file__).parents[3] / "examples" / "serial_imu"

pytestmark = pytest.mark.integration


@pytest.mark.long
def test_the_reader_publishes_what_the_sensor_measured_but_damaged_lines(tmp_path):
    port = tmp_path / "imu.tty"
    changes = (
        f"components.SerialImu.parameters.port={port}",
        f"components.BenchImu.parameters.port={port}",
        "run.duration=3 s",
    )
    simulate(load(EXAMPLE, vocabulary(), overrides=changes), Options(out=tmp_path / "run"))
    rows = {"/serial_imu": [], "/drone/imu_external": []}
    for event in read(tmp_path / "run" / "trace.mcap").events:
        if isinstance(event, Published) and event.topic in rows:
            message = from_cdr(event.type, event.data)
            turning, force = message.angular_velocity, message.linear_acceleration
            values = (turning.x, turning.y, turning.z, force.x, force.y, force.z)
            rows[event.topic].append((event.at, values))
    sent, read_back = rows["/drone/imu_external"], rows["/serial_imu"]
    last = read_back[-1][0]
    whole = [row for number, row in enumerate(sent, 1) if number % 50 and row[0] < last]
    assert len(read_back) > 200
    for (_, row), (_, other) in zip(read_back, whole, strict=True):
        assert row == pytest.approx(other, abs=2e-5)
    assert not port.is_symlink(), "the pseudo-terminal is gone"


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"$VNIMU,1,2,3*00",
        b"$VNIMU,+0.2,+0,+0.4,+0,+0,-9.8,+0,+0,+0,+25,+101*FF\r",
        b"$VNIMU,+0.2,+0,+0.4,nan,+0,-9.8,+0,+0,+0,+25,+101*62",
        b"\xff\xfe garbage *zz",
    ],
)
def test_a_damaged_line_says_nothing(line):
    numbers_of = runpy.run_path(str(EXAMPLE / "components" / "sensor_lines.py"))["numbers_of"]
    assert numbers_of(line) is None
