"""A model whose runs take milliseconds and end in every way, for tests of campaigns."""

from __future__ import annotations

from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest

from volery.explore.executors import executors
from volery.explore.points import CampaignRow

MODEL = """
volery: 1
name: counting
components:
  Counter:
    language: python
    path: counter.py
    active: true
    parameters: {count: 3, do: work}
application: {counter: {is: Counter}}
platform: {processors: {pc: {is: rpi4-cortex-a72, frequency: 1500 MHz}}}
allocations: {only: {counter: pc}, slow: {extends: only, set: {platform.processors.pc.frequency: 600 MHz}}}
scenarios: {long: {set: {components.Counter.parameters.count: 9}}}
requirements: {counted: {observe: note.step.done, min: 5}}
run: {duration: 20 s}
"""
COUNTER = """
import ctypes
import os
import random
import volery

class Counter:
    def __init__(self, count, do):
        self.count, self.do = count, do

    def run(self):
        if self.do == "raise":
            raise ValueError("out of paper")
        if self.do == "crash":
            os.abort()
        if self.do == "fill":
            held = [bytes(range(256)) * 400_000 for _ in range(20)]
        if self.do == "hang":
            ctypes.CDLL(None).pause()
        for step in range(self.count):
            volery.note("step", str(step), "done")
            volery.sleep(random.random())
"""
MACHINE = ["wall_s", "cpu_s", "host", "attempt"]
"""Columns that differ from machine to machine."""
DO = "components.Counter.parameters.do"
COUNT = "components.Counter.parameters.count"


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """Return the folder of the model."""
    folder = tmp_path / "model"
    folder.mkdir()
    (folder / "counter.py").write_text(COUNTER)
    (folder / "model.yaml").write_text(MODEL)
    return folder


def same_rows(one: Any, other: Any) -> bool:
    """Return whether two tables are equal but for the columns that differ from machine to machine."""
    return bool(one.drop(columns=MACHINE).equals(other.drop(columns=MACHINE)))


class StubEngine(Executor):
    """Stands for an engine whose workers make rows at once, and not by a simulation.

    Args:
        address: Number of the task with which it is lost; empty: never.
        workers: Runs at a time.
    """

    def __init__(self, address: str, workers: int) -> None:
        self.workers = workers or 2
        self.left = int(address) if address else -1

    def submit(self, function: Any, /, task: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.left -= 1
        if self.left == -1:
            future.set_exception(ConnectionError("the cable was cut"))
            return future
        seconds = task.point.seed % 1000 / 10.0
        observables = {"drone_1.energy": 1000.0 + seconds, "drone_1.distance": seconds}
        verdicts = {"in_time": seconds < 90.0, "counted": True}
        future.set_result(
            CampaignRow(
                task.run,
                task.point,
                "completed",
                "",
                verdicts,
                observables,
                seconds,
                0.1,
                0.1,
                "stub",
                task.attempt,
            )
        )
        return future


executors.add("stub", StubEngine)
