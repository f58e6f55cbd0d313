"""The commands that run something, as a user starts them: processes, signals, sockets, files."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from volery.cli.commands.first_steps import example
from volery.requirements.record import read_record

pytestmark = pytest.mark.integration

COMMAND = (sys.executable, "-c", "from volery.cli.main import main; main()")
WITHIN_S = 300


def volery(*arguments, cwd):
    command = [*COMMAND, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=WITHIN_S, check=False)


@pytest.fixture
def starter(tmp_path):
    assert volery("new", "patrol", cwd=tmp_path).returncode == 0
    return tmp_path / "patrol"


def test_the_starter_runs_and_meets_its_requirements(starter):
    done = volery("simulate", "patrol", "--out", "out", "--json", cwd=starter.parent)
    assert done.returncode == 0, done.stderr
    record = json.loads(done.stdout)
    assert record["outcome"]["status"] == "completed"
    assert record["requirements"]["landing"]["met"]
    assert record["components"]["patrol"]["processor"] == "onboard"
    kept = {path.name for path in (starter.parent / "out").iterdir()}
    assert {"run.json", "trace.mcap", "timeline.json", "report.html"} <= kept
    assert json.loads((starter.parent / "out" / "run.json").read_text()) == record


def test_the_starter_runs_with_stated_times(starter):
    arguments = ("--fidelity", "times", "--allocation", "slow", "--scenario", "windy", "--json")
    done = volery("simulate", "patrol", *arguments, cwd=starter.parent)
    assert done.returncode == 0, done.stderr
    record = json.loads(done.stdout)
    assert (record["allocation"], record["scenario"], record["fidelity"]) == ("slow", "windy", "times")
    assert (starter.parent / "runs" / "field-patrol-1" / "run.json").exists()


def test_a_requirement_that_is_not_met_is_a_failure(starter):
    strict = ("--set", "requirements.battery.min=99.9 %")
    done = volery("simulate", "patrol", *strict, "--quiet", "--out", "out", cwd=starter.parent)
    assert (done.returncode, done.stdout) == (1, "")
    assert "the requirement 'battery' is not met" in done.stderr
    outcome = json.loads((starter.parent / "out" / "run.json").read_text())["outcome"]
    assert (outcome["status"], outcome["requirements_met"]) == ("completed", False)


def test_a_component_that_raises_is_named(starter):
    file = starter / "components" / "route_planner.py"
    way = "here, order, left ="
    file.write_text(file.read_text().replace(way, f"raise RuntimeError('no map')\n        {way}"))
    done = volery("simulate", "patrol", "--out", "out", cwd=starter.parent)
    assert done.returncode == 1
    assert "planner" in done.stderr
    assert "no map" in done.stderr
    assert "Traceback" not in done.stderr
    assert json.loads((starter.parent / "out" / "run.json").read_text())["outcome"]["status"] == "failed"


def test_ctrl_c_finishes_the_files(starter):
    """Paced, so that there is something to interrupt; it is interrupted once the trace has begun."""
    arguments = ("simulate", "patrol", "--speed", "5", "--out", "out")
    process = subprocess.Popen(
        [*COMMAND, *arguments], cwd=starter.parent, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    trace = starter.parent / "out" / "trace.mcap"
    try:
        until(lambda: trace.exists() and trace.stat().st_size > 100_000, process)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=WITHIN_S)
    finally:
        process.kill()
    assert process.returncode == 1, err.decode()
    assert b"SIGINT" in err
    record = json.loads((starter.parent / "out" / "run.json").read_text())
    assert record["outcome"]["status"] == "interrupted"
    assert (starter.parent / "out" / "report.html").exists()


def until(holds, process):
    """Wait, on the process's own end, until *holds*."""
    for _ in range(WITHIN_S * 10):
        if holds():
            return
        try:
            process.wait(timeout=0.1)
        except subprocess.TimeoutExpired:
            continue
        break
    pytest.fail(f"it ended, or took too long: {process.stderr.read1().decode() if process.stderr else ''}")


def test_a_mission_flies_on_a_simulated_drone(starter):
    done = volery(
        "fly", "patrol/mission.py", "--on", "sim:ardupilot", "--json", "--out", "out", cwd=starter.parent
    )
    assert done.returncode == 0, done.stderr
    (drone,) = json.loads(done.stdout)["vehicles"].values()
    assert drone["landed"]


@pytest.mark.parametrize(
    ("url", "status", "complaint"),
    [
        ("ardupilot+tcp://127.0.0.1:9", 1, "127.0.0.1:9"),
        ("pigeon+tcp://127.0.0.1:5760", 2, "pigeon"),
        ("somewhere", 2, "sim:ardupilot"),
    ],
)
def test_addresses_that_lead_nowhere(starter, url, status, complaint):
    done = volery("fly", "patrol/mission.py", "--on", url, cwd=starter.parent)
    assert done.returncode == status, done.stderr
    assert complaint in done.stderr
    assert "Traceback" not in done.stderr


def test_a_mission_with_coordinates_off_the_globe_is_bad_input(starter):
    goto = "drone.goto(Position(143.0, 0.0, AMSL(9)))"
    mission = f"from volery import AMSL, Position\n\ndef mission(drone):\n    {goto}\n"
    (starter / "mission.py").write_text(mission)
    done = volery("fly", "patrol/mission.py", "--on", "sim:ardupilot", cwd=starter.parent)
    assert done.returncode == 2, done.stderr
    assert "latitude 143.0 is off the globe" in done.stderr


def test_a_served_vehicle_can_be_flown_over_a_socket(starter):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    arguments = ("vehicle", "serve", "ardupilot", "--listen", f"tcp://127.0.0.1:{port}", "--speed", "10")
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    in_a_script = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"  # begun with &
    command = [*COMMAND[:2], f"{in_a_script}; {COMMAND[2]}", *arguments]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True)
    try:
        ready, _, _ = select.select([server.stdout], [], [], WITHIN_S)
        assert ready, "the server did not say that it serves"
        assert "serving ardupilot" in server.stdout.readline()
        url = f"ardupilot+tcp://127.0.0.1:{port}"
        done = volery(
            "fly", example("starter") / "mission.py", "--on", url, "--out", "out", cwd=starter.parent
        )
        assert done.returncode == 0, done.stderr
        assert "simulated" not in done.stdout  # it was flown in real time, whatever flew there
        _is_told_by_its_autopilot(read_record(starter.parent / "out"))
        server.send_signal(signal.SIGTERM)
        assert server.wait(timeout=WITHIN_S) == 0
    finally:
        server.kill()


def _is_told_by_its_autopilot(record):
    """Of a vehicle out there the report has what it says of itself, and no truth."""
    (drone,) = record.vehicles.values()
    assert record.is_real
    assert drone.landed
    assert drone.distance_m > 10.0
    assert drone.airborne_s > 1.0
    assert 0.0 < drone.battery < 1.0
    assert drone.energy_j > 0.0
    assert drone.error_by_truth_m.horizontal is None


def test_a_folder_that_cannot_be_written(starter):
    done = volery("simulate", "patrol", "--out", Path("/dev/null/out"), cwd=starter.parent)
    assert done.returncode == 2
    assert "cannot write" in done.stderr


def children_of(pid: int) -> list[int]:
    return [int(one) for one in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


@pytest.mark.timeout(1000)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_demo_that_is_ended_leaves_no_process(tmp_path, number):
    """A signal ends both simulations in order, with their files; after SIGKILL they end by themselves."""
    command = [*COMMAND, "demo", "--out", "demo"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    traces = [tmp_path / "demo" / name / "trace.mcap" for name in ("fast", "slow")]
    workers = []
    try:
        until(lambda: all(one.exists() and one.stat().st_size > 100_000 for one in traces), process)
        workers = [os.pidfd_open(one) for one in children_of(process.pid)]
        assert len(workers) == 2
        process.send_signal(number)
        process.wait(timeout=WITHIN_S)
        for worker in workers:  # readable when it has ended
            assert select.select([worker], [], [], WITHIN_S if number == signal.SIGKILL else 0)[0]
    finally:
        process.kill()
        for worker in workers:
            os.close(worker)
    if number == signal.SIGINT:
        assert process.returncode == 1
        assert (tmp_path / "demo" / "comparison.html").exists()
    records = [json.loads((one.parent / "run.json").read_text()) for one in traces]
    assert [one["outcome"]["reason"] for one in records] == ["SIGTERM received"] * 2


def test_the_demo_shows_both_allocations_and_is_no_failure(tmp_path):
    command = [*COMMAND, "demo", "--out", "demo"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=990, check=False)
    assert done.returncode == 0, done.stderr
    records = {
        name: json.loads((tmp_path / "demo" / name / "run.json").read_text()) for name in ("fast", "slow")
    }
    for record in records.values():
        assert [parcel["state"] for parcel in record["notes"]["parcel"].values()] == ["delivered"] * 3
    missed = [name for name, found in records["slow"]["requirements"].items() if not found["met"]]
    assert missed
    for name in missed:
        assert f"slow: the requirement '{name}'" in " ".join(done.stderr.split())
    assert "parcel-1: delivered" in done.stdout
    assert "report.html" in done.stderr


def test_a_mission_is_flown_on_two_addresses_and_compared(tmp_path):
    mission = "def mission(drone):\n    drone.takeoff(5)\n    drone.land()\n"
    (tmp_path / "hop.py").write_text(mission)
    between = ("--between", "sim:px4", "sim:ardupilot")
    done = volery("runs", "compare", "hop.py", *between, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, second = json.loads(done.stdout)
    assert [list(one["vehicles"]) for one in (first, second)] == [["px4"], ["ardupilot"]]
    (found,) = second["comparison"]
    assert found["sides"] == ["sim:px4", "sim:ardupilot"]
    phases = {one["phase"]: one for one in found["phases"]}
    assert list(phases) == ["before arming", "armed", "takeoff", "land"]
    assert phases["takeoff"]["path_m"] < 2.0
    land = [read_record(tmp_path / "runs" / f"hop-{number}") for number in (1, 2)]
    durations = [
        next(one.end_s - one.start_s for one in record.vehicles[name].operations if one.operation == "land")
        for record, name in zip(land, ("px4", "ardupilot"), strict=True)
    ]
    assert phases["land"]["seconds"] == pytest.approx(durations, abs=0.001)
    assert (tmp_path / "runs" / "comparison.html").exists()
