"""A run in a process of its own: the trace of a session here, and neither process can hurt the other."""

from __future__ import annotations

import hashlib
import os
import signal
import socket
import subprocess
import sys
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Thread

import pytest

from volery import CapabilityError, ModelError, Options, ProcessRunSession, RunSession, UsageError
from volery.base.time import S
from volery.requirements.record import read_record
from volery.run import process_session
from volery.run.process_session import _Outbox
from volery.trace.events import Milestone, Published, VehicleState
from volery.trace.reader import OpenTrace

EXAMPLES = Path(__file__).parents[3] / "examples"

MODEL = """
volery: 1
name: counting
components: {Counter: {language: python, path: counter.py, active: true}}
application: {counter: {is: Counter}}
platform: {processors: {pc: {is: rpi4-cortex-a72, frequency: 1500 MHz}}}
allocations: {only: {counter: pc}}
environment:
  origin: {latitude: 47, longitude: 8}
  places: {here: {east: 0 m, north: 0 m}}
run: {duration: 1000 s}
"""
COUNTER = """
import os
import volery
class Counter:
    def run(self):
        for count in range(1000):
            volery.note("count", "it", str(count))
            volery.sleep(0.7)
            if count == LAST:
                os.kill(os.getpid(), 9)
"""
WATCHER = """
import sys
from pathlib import Path
from volery import Options, ProcessRunSession
from volery.trace.events import Milestone
out = Path(sys.argv[2])
with ProcessRunSession(sys.argv[1], Options(out=out, pace=1.0)) as session:
    session.tap(lambda event: print(event.state, flush=True), Milestone)
    print(session.run().record.outcome.reason)
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    (tmp_path / "counter.py").write_text(COUNTER.replace("LAST", "-1"))
    (tmp_path / "model.yaml").write_text(MODEL)
    return tmp_path / "model.yaml"


def children() -> set[str]:
    """Return the numbers of the processes that this one has started and not taken leave of."""
    return {
        number
        for task in Path("/proc/self/task").iterdir()
        for number in (task / "children").read_text().split()
    }


@pytest.mark.parametrize(("example", "duration"), [("starter", 15), ("delivery", 3)])
def test_the_trace_is_that_of_a_session_in_this_process(example, duration, tmp_path):
    digests = []
    for kind in (RunSession, ProcessRunSession):
        out = tmp_path / kind.__name__
        session = kind(EXAMPLES / example, Options(out=out), overrides=[f"run.duration={duration} s"])
        seen = []
        session.tap(seen.append, VehicleState)
        assert session.step(S)
        assert session.now == S
        vehicles = session.progress()
        run = session.run()
        trace = hashlib.sha256((out / "trace.mcap").read_bytes()).hexdigest()
        digests.append((trace, repr(seen), vehicles, session.now, run.record.outcome, run.observables))
    assert digests[0] == digests[1]
    assert session.dropped == 0


def test_it_is_steered_by_any_thread_while_another_runs_it(model, tmp_path):
    before = children()
    with ProcessRunSession(model, Options(out=tmp_path / "run", pace=1.0)) as session:
        states, ended = [], []

        def listen(event):
            states.append(event.state)
            if event.state == "1":
                session.pace = 1000.0
            elif event.state == "100":
                session.pause()
                session.resume()
            elif event.state == "200":
                with pytest.raises(UsageError, match="a listener cannot step"):
                    session.step(S)
                watcher.start()

        def watch():
            with pytest.raises(UsageError, match="another thread steps or runs"):
                session.run()
            ended.append(session.stop("enough seen"))

        watcher = Thread(target=watch)
        session.tap(listen, Milestone)
        with pytest.raises(UsageError, match="has not ended"):
            _ = session.result
        for wrong in (0, 0.5 * S):
            with pytest.raises(UsageError, match="give a whole number above 0"):
                session.step(wrong)
        with pytest.raises(UsageError, match="a pace of 0"):
            session.pace = 0.0
        with pytest.raises(UsageError, match="is no kind of event; there is Activation"):
            session.tap(print, int)
        run = session.run()
        watcher.join(60.0)
        assert ended == [run]
        assert (session.pace, session.running) == (1000.0, False)
        assert run.record.outcome.reason == "enough seen"
        assert states[:201] == [str(count) for count in range(201)]
        assert (tmp_path / "run" / "report.html").exists()
        assert not session.step(S)
    assert children() <= before


def test_leaving_it_ends_the_run_in_order(model):
    with ProcessRunSession(model) as session:
        session.pause()  # holds run() and nothing else
        assert session.step(3 * S)
    assert session.result.record.outcome.reason == "its session was left"
    assert session.now >= 3 * S


def test_what_a_listener_raises_ends_the_run(model):
    def refuse(event):
        raise ValueError("no")

    session = ProcessRunSession(model)
    session.tap(refuse)
    with pytest.raises(ValueError, match="no"):
        session.run()
    assert session.result.record.outcome.reason == "ValueError: no"
    assert not session.result.ok


@pytest.mark.parametrize(
    ("error", "options", "arguments"),
    [
        (CapabilityError, {"fidelity": "hardware"}, {}),
        (UsageError, {}, {"allocation": "none"}),
        (ModelError, {}, {"overrides": ["run.duration=blue"]}),
        (UsageError, {"out": Path("/dev/null/run")}, {}),
    ],
)
def test_its_errors_are_those_of_a_session_in_this_process(error, options, arguments, model):
    before = children()
    said = []
    for kind in (RunSession, ProcessRunSession):
        with pytest.raises(error) as raised:
            kind(model, Options(**options), **arguments)
        said.append(str(raised.value))
    assert said[0] == said[1]
    assert children() <= before


def test_a_component_that_kills_the_process_fails_the_run_and_nothing_else(model, tmp_path):
    (tmp_path / "counter.py").write_text(COUNTER.replace("LAST", "700"))
    with ProcessRunSession(model, Options(out=tmp_path / "run")) as session:
        states = []
        session.tap(lambda event: states.append(event.state), Milestone)
        assert session.step(400 * S)
        run = session.run()
    assert run.error is not None
    assert "the process that ran the components was ended after 0:0" in str(run.error)
    assert str(run.error).endswith("SIGKILL")
    assert session.now >= 400 * S
    assert run.record.sim_s >= 400.0
    assert read_record(tmp_path / "run").outcome == run.record.outcome
    with OpenTrace(tmp_path / "run" / "trace.mcap") as reading:
        assert any(isinstance(event, Milestone) for event in reading.events())


@pytest.mark.parametrize(("number", "reason"), [(signal.SIGINT, "SIGINT received"), (signal.SIGKILL, "")])
def test_it_ends_in_order_and_once_with_the_program_that_watches_it(number, reason, model, tmp_path):
    out = tmp_path / "run"
    reading, writing = os.pipe()  # both processes have it: its end is the end of both
    with subprocess.Popen(
        [sys.executable, "-c", WATCHER, model, out],
        stdout=writing,
        text=True,
        process_group=0,  # as the job of a terminal
    ) as watcher:
        os.close(writing)
        with os.fdopen(reading) as lines:
            assert lines.readline() == "0\n"
            os.killpg(watcher.pid, number)
            said = lines.read().splitlines()
    assert [line for line in said if not line.isdigit()] == ([reason] if reason else [])
    outcome = read_record(out).outcome
    assert outcome.status == "interrupted"
    assert outcome.reason == (reason or "the program that watched it has ended")
    assert (out / "report.html").exists()


def exchange(*, lossless):
    """Return what an outbox sends of 50 batches, of which a reader takes none before the last is there."""
    ours, theirs = socket.socketpair()
    outbox = _Outbox(Connection(theirs.detach()), lossless=lossless)
    link = Connection(ours.detach())

    def write():
        for count in range(50):
            outbox.put(Published(count, "/image", "sensor_msgs/msg/Image", "camera", bytes(100_000)))
        outbox.finish("ended", None)

    writer = Thread(target=write)
    writer.start()
    if not lossless:
        while not outbox._answers:
            writer.join(0.01)
    received = []
    while True:
        what, content = link.recv()
        if what == "ended":
            break
        events, dropped = content
        received += process_session.pickle.loads(events)
    writer.join(60.0)
    return [event.at for event in received], dropped


def test_the_oldest_events_are_dropped_and_counted_if_a_listener_is_slow(monkeypatch):
    monkeypatch.setattr(process_session, "WAITING_BYTES", 1_000_000)
    times, dropped = exchange(lossless=False)
    assert times[-5:] == [45, 46, 47, 48, 49]
    assert dropped == 50 - len(times)
    assert dropped >= 30


def test_a_lossless_session_waits_for_its_listeners(monkeypatch):
    monkeypatch.setattr(process_session, "WAITING_BYTES", 1_000_000)
    assert exchange(lossless=True) == ([*range(50)], 0)
