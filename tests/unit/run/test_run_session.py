"""A run as an object: stepped, paused, watched and stopped, with the trace of a run in one go."""

from __future__ import annotations

import hashlib
from pathlib import Path
from threading import Thread

import pytest

from volery import Options, RunSession, simulate
from volery.base.errors import CapabilityError, ModelError, UsageError
from volery.base.time import MS, S
from volery.trace.events import Milestone, Text

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
  vehicles: {drone_1: {kind: multirotor, autopilot: px4, at: here}}
run: {duration: 20 s}
"""
COUNTER = """
import volery
class Counter:
    def run(self):
        for count in range(1000):
            volery.note("count", "it", str(count))
            volery.log(f"at {count}")
            volery.sleep(0.7)
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    (tmp_path / "counter.py").write_text(COUNTER)
    (tmp_path / "model.yaml").write_text(MODEL)
    return tmp_path / "model.yaml"


def digest(folder: Path | None) -> str:
    assert folder is not None
    return hashlib.sha256((folder / "trace.mcap").read_bytes()).hexdigest()


def test_the_trace_is_the_same_however_a_session_is_stepped(model, tmp_path):
    whole = simulate(model, Options(out=tmp_path / "whole"))
    session = RunSession(model, Options(out=tmp_path / "stepped"))
    steps = [7, 333 * MS, S, 1]
    count = 0
    while session.step(steps[count % 4]):
        count += 1
    assert count > 40
    assert session.now == 20 * S
    assert not session.running
    assert session.result.record.outcome == whole.record.outcome
    assert digest(session.result.folder) == digest(whole.folder)
    assert not session.step(S)


def test_it_is_watched_by_kinds_of_events(model):
    session = RunSession(model, Options(out=None))
    notes, everything = [], []
    session.tap(notes.append, Milestone)
    session.tap(everything.append)
    assert session.step(2 * S)
    assert session.now == 2 * S
    assert [note.state for note in notes] == ["0", "1", "2"]
    assert {Milestone, Text} <= {type(event) for event in everything}
    [drone] = session.progress()
    assert (drone.name, drone.armed) == ("drone_1", False)
    with pytest.raises(UsageError, match="has not ended"):
        _ = session.result
    session.stop()


def test_it_stops_in_order_and_says_why(model, tmp_path):
    session = RunSession(model, Options(out=tmp_path / "run"))
    session.step(3 * S)
    run = session.stop("enough seen")
    assert (run.record.outcome.status, run.record.outcome.reason) == ("interrupted", "enough seen")
    assert session.stop() is run
    assert (tmp_path / "run" / "report.html").exists()


def test_another_thread_holds_it_and_lets_it_go_on(model):
    session = RunSession(model, Options(out=None))
    session.tap(lambda event: session.pause() if event.state == "5" else None, Milestone)
    ended = []
    runner = Thread(target=lambda: ended.append(session.run()))
    runner.start()
    while session.now < 4 * S and runner.is_alive():
        runner.join(0.01)
    runner.join(0.2)
    held = session.now
    assert 3 * S < held < 5 * S
    session.resume()
    runner.join(60.0)
    assert ended[0].completed
    assert session.now == 20 * S


def test_its_pace_is_set_between_steps(model):
    session = RunSession(model, Options(out=None))
    assert session.pace is None
    session.pace = 50.0
    assert session.step(S)
    assert session.pace == 50.0
    session.pace = None
    assert session.run().completed
    with pytest.raises(UsageError, match="pace"):
        session.pace = 0.0


def test_what_is_wrong_is_said_before_anything_starts(model):
    with pytest.raises(UsageError, match="step of 0 ns"):
        RunSession(model, Options(out=None)).step(0)
    with pytest.raises(
        CapabilityError, match="'hardware' is not there yet; there is code, firmware or times"
    ):
        RunSession(model, Options(out=None, fidelity="hardware"))
    with pytest.raises(UsageError, match="no allocation named 'none'"):
        RunSession(model, Options(out=None), allocation="none")
    with pytest.raises(ModelError, match="duration"):
        RunSession(model, Options(out=None), overrides=["run.duration=blue"])


def test_what_a_tap_raises_ends_the_run(model):
    def refuse(event):
        raise ValueError("no")

    session = RunSession(model)
    session.tap(refuse)
    with pytest.raises(ValueError, match="no"):
        session.run()
    assert not session.running
    assert not session.result.ok
    assert not session.step(S)


def test_a_step_is_a_whole_number_of_nanoseconds(model):
    session = RunSession(model)
    for wrong in (0, -1, 0.5 * S, "1"):
        with pytest.raises(UsageError, match="give a whole number above 0"):
            session.step(wrong)
    assert session.now == 0


def test_another_thread_cannot_step_or_stop_it(model):
    session, said = RunSession(model), []

    def misuse():
        for use in (lambda: session.step(S), session.run, session.stop):
            with pytest.raises(UsageError, match="another thread began this run") as raised:
                use()
            said.append(raised)

    session.step(S)
    thread = Thread(target=misuse)
    thread.start()
    thread.join()
    assert len(said) == 3
    assert session.stop().record.outcome.status == "interrupted"


def test_a_script_whose_error_computes_its_text_has_failed(model):
    (model.parent / "counter.py").write_text(
        "class Lost(Exception):\n    def __str__(self):\n        return 'no link'\n\nraise Lost\n"
    )
    model.write_text(MODEL.replace("language: python", "language: rospy"))
    run = RunSession(model, Options("code")).run()
    assert not run.ok
    assert str(run.error) == "counter: run raised Lost: no link (counter.py:5)"
