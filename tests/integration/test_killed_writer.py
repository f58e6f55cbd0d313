"""What a killed process leaves behind: everything but at most the last simulated second."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from volery.base.time import S
from volery.report.html_report import recover
from volery.trace.events import VehicleState
from volery.trace.reader import read

pytestmark = pytest.mark.integration

_WRITER = """
import sys
from pathlib import Path
from volery.testing.sample_run import sample_events, sample_setup
from volery.trace.mcap_writer import McapWriter
from volery.trace.timeline import TimelineWriter
from volery.trace.events import VehicleState

folder = Path(sys.argv[1])
writer, timeline = McapWriter(folder / "trace.mcap", sample_setup()), TimelineWriter(folder / "timeline.json")
for event in sample_events(seconds=float(sys.argv[2])):
    writer(event)
    timeline(event)
    if isinstance(event, VehicleState) and event.at >= 42_500_000_000 and sys.argv[3] == "wait":
        print("there", flush=True)
        sys.stdin.read()
writer.close()
timeline.close()
"""


def run_writer(folder: Path, seconds: float, how: str, hash_seed: str = "0") -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", _WRITER, str(folder), str(seconds), how],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
    )


def test_killed_in_the_middle_of_a_second(tmp_path: Path) -> None:
    with run_writer(tmp_path, 100.0, "wait") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "there\n"
        process.send_signal(signal.SIGKILL)
    trace = read(tmp_path / "trace.mcap")
    last = max(event.at for event in trace.events if isinstance(event, VehicleState))
    assert 41.5 * S <= last < 42.5 * S
    assert not trace.complete
    found = recover(tmp_path)
    assert found.record.outcome.status == "unfinished"
    assert found.report.exists()


def test_the_same_bytes_whatever_the_hash_seed(tmp_path: Path) -> None:
    contents = []
    for hash_seed in ("0", "1"):
        folder = tmp_path / hash_seed
        folder.mkdir()
        with run_writer(folder, 20.0, "go", hash_seed) as process:
            assert process.wait(300) == 0
        contents.append([(folder / name).read_bytes() for name in ("trace.mcap", "timeline.json")])
    assert contents[0] == contents[1]
