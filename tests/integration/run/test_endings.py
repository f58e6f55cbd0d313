"""However a run ends, its files are finished, its vehicles are down, and what ended it is named."""

from __future__ import annotations

import json
import os
import select
import signal
from dataclasses import replace

import pytest

from volery import Options, simulate
from volery.run import run_session
from volery.trace.events import VehicleState
from volery.trace.reader import read

pytestmark = pytest.mark.integration

LAND = "        self._drone.land()\n"
HOVER = "        volery.sleep(1500)\n"
RAISE = "        raise ValueError('the camera fell off')\n"
FREEZE = "        for _ in iter(int, 1):  # time passes in a loop of while\n            pass\n"


def record(folder):
    return json.loads((folder / "run.json").read_text())


def truths(folder):
    trace = read(folder / "trace.mcap")
    return trace, [event for event in trace.events if isinstance(event, VehicleState)]


def assert_brought_down(folder):
    """It was up, and at the end it stands disarmed; the trace is whole and tells how it ended."""
    trace, states = truths(folder)
    assert trace.complete
    assert max(state.z for state in states) > 3.0
    assert states[-1].z < 0.5
    assert record(folder)["vehicles"]["drone_1"]["landed"]
    assert {"run.json", "trace.mcap", "timeline.json", "report.html"} <= {
        path.name for path in folder.iterdir()
    }
    json.loads((folder / "timeline.json").read_text())


@pytest.fixture
def in_the_air(commands, one_drone):
    """A run of a drone that hovers, five times as fast as real time, once it has recorded a while of it."""
    folder = one_drone(commands.folder, HOVER)

    def begin(pace=5):
        process = commands.start("simulate", folder, "--speed", pace, "--out", "out")
        trace = folder / "out" / "trace.mcap"
        commands.until(process, lambda: trace.exists() and trace.stat().st_size > 300_000)
        return process

    return begin


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_run_in_order(commands, in_the_air, number):
    process = in_the_air(20)
    process.send_signal(number)
    done = commands.end_of(process)
    assert done.returncode == 1
    assert number.name in done.stderr
    assert "Traceback" not in done.stderr
    assert record(commands.folder / "out")["outcome"]["status"] == "interrupted"
    assert_brought_down(commands.folder / "out")


def test_a_second_ctrl_c_stops_at_once(commands, in_the_air):
    """The way down takes a while at this pace; the files are finished all the same."""
    process = in_the_air()
    process.send_signal(signal.SIGINT)
    text = commands.folder / "out" / "trace.mcap"
    size = text.stat().st_size
    commands.until(process, lambda: text.stat().st_size > size)  # it goes on, with the way down
    process.send_signal(signal.SIGINT)
    done = commands.end_of(process)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    outcome = record(commands.folder / "out")["outcome"]
    assert outcome["status"] == "interrupted"
    assert "second signal" in outcome["reason"]
    trace, states = truths(commands.folder / "out")
    assert trace.complete
    assert states[-1].z > 1.0


TALKS = """
import volery
from pathlib import Path

def mission(drone):
    drone.takeoff(8)
    for second in range(1500):
        print(second, flush=True)
        Path("printed").write_text(str(second))
        if Path("closed").exists() and second > int(Path("closed").read_text()) + 3:
            break
        volery.sleep(1)
    drone.land()
"""


@pytest.fixture
def on_a_terminal(commands):
    """A flight that has begun to print on a terminal of its own, which is read until then."""
    (commands.folder / "talks.py").write_text(TALKS)

    def begin(prelude=""):
        master, line = os.openpty()
        arguments = ("fly", "talks.py", "--on", "sim:ardupilot", "--speed", 10, "--out", "out")
        process = commands.start(*arguments, prelude=prelude, terminal=line)
        os.close(line)

        def printed():
            while select.select([master], [], [], 0.0)[0]:
                os.read(master, 65536)
            return (commands.folder / "printed").exists()

        commands.until(process, printed)
        return process, master

    return begin


def test_a_flight_lands_when_its_terminal_is_closed(commands, on_a_terminal):
    process, master = on_a_terminal()
    os.close(master)
    assert commands.end_of(process).returncode == 1
    outcome = record(commands.folder / "out")["outcome"]
    assert (outcome["status"], outcome["reason"]) == ("interrupted", "SIGHUP received")
    _, states = truths(commands.folder / "out")
    assert max(state.z for state in states) > 3.0
    assert states[-1].z < 0.5
    assert not states[-1].armed
    assert (commands.folder / "out" / "report.html").exists()


def test_a_flight_under_nohup_goes_on_when_its_terminal_is_closed(commands, on_a_terminal):
    process, master = on_a_terminal("import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)")
    os.close(master)
    closed = commands.folder / "closed.part"
    closed.write_text((commands.folder / "printed").read_text())
    closed.rename(commands.folder / "closed")
    assert commands.end_of(process).returncode == 0
    assert record(commands.folder / "out")["outcome"]["status"] == "completed"


def test_after_a_kill_the_report_recovers_the_run(commands, in_the_air):
    process = in_the_air()
    process.kill()
    commands.end_of(process)
    folder = commands.folder / "out"
    assert not (folder / "run.json").exists()
    done = commands.run("runs", "report", "out", "--json")
    assert done.returncode == 0, done.stderr
    assert (folder / "report.html").exists()
    recovered = json.loads(done.stdout)
    trace, states = truths(folder)
    assert not trace.complete
    assert recovered["outcome"]["status"] == "unfinished"
    assert recovered["sim_s"] == pytest.approx(states[-1].at / 1e9, abs=1.0)
    assert recovered["vehicles"]["drone_1"]["airborne_s"] > 0.0


def test_a_component_that_raises_in_the_air(tmp_path, one_drone):
    run = simulate(one_drone(tmp_path, RAISE), Options(out=tmp_path / "out"))
    outcome = record(run.folder)["outcome"]
    assert outcome["status"] == "failed"
    assert "pilot" in outcome["reason"]
    assert "the camera fell off" in outcome["reason"]
    assert_brought_down(run.folder)


@pytest.mark.parametrize("fidelity", ["times", "code"])
def test_an_endless_loop_is_named_with_its_line(tmp_path, monkeypatch, fidelity, one_drone):
    monkeypatch.setattr(run_session, "PATIENCE_S", 2.0)
    run = simulate(one_drone(tmp_path, FREEZE), Options(fidelity, out=tmp_path / "out"))
    outcome = record(run.folder)["outcome"]
    assert outcome["status"] == "failed"
    assert "pilot: virtual time is frozen" in outcome["reason"]
    assert "pilot.py:" in outcome["reason"]
    assert_brought_down(run.folder)


FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))"
"""A file that reaches this size cannot be written on: as on a full disk, but for the words."""


def test_a_full_folder_is_reported_and_the_flight_continues(commands, one_drone):
    folder = one_drone(commands.folder, LAND)
    until = ("--set", "run.until={observe: drone_1.landing_offset, min: 0 m}")
    done = commands.run("simulate", folder, *until, "--out", "out", prelude=FULL)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "trace.mcap" in done.stderr
    kept = record(folder / "out")
    assert kept["outcome"]["status"] == "completed"
    assert kept["vehicles"]["drone_1"]["landed"]


def test_a_folder_that_is_not_writable(commands, one_drone):
    folder = one_drone(commands.folder, HOVER)
    done = commands.run("simulate", folder, "--out", "/proc/volery")
    assert done.returncode == 2
    assert "cannot write into /proc/volery" in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr


def test_a_folder_is_used_again_without_a_trace_of_the_earlier_run(tmp_path, one_drone):
    out = tmp_path / "out"
    simulate(one_drone(tmp_path, RAISE), Options(out=out))
    run = simulate(one_drone(tmp_path, LAND), replace(Options(), out=out), overrides=["run.duration=2 min"])
    assert run.completed
    assert record(out)["failures"] == []
    assert read(out / "trace.mcap").complete
