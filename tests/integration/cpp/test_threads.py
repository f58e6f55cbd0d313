"""Threads of the C++ library, and waits for them, are tasks and waits of the run."""

from __future__ import annotations

import pytest

from volery.trace.events import Failure, Text

pytestmark = pytest.mark.integration

MODEL = """
volery: 1
name: threads
components:
  Threads:
    language: c++
    path: threads.cpp
    build: {flags: -O0}
    active: true
    at: {processor: intel-i5-3470, frequency: 3000 MHz}
    activation: {time: 0.1 us}
application: {threads: {is: Threads}}
platform: {processors: {pc: {is: intel-i5-3470, frequency: 3000 MHz}}}
allocations: {only: {threads: pc}}
run: {duration: 5 s}
"""


def test_threads_and_waits(run_model):
    outcome = run_model(MODEL, "threads.cpp")
    assert outcome.run.completed, outcome.run.record.outcome
    said = [one.text for one in outcome.of(Text) if one.source == "threads"]
    assert said[:-1] == [
        "held 1 at 0.5",
        "locked 1 at 0.5",
        "notified 1 at 0.7",
        "in time 0 at 1.0",
        "late 1 at 1.0",
        "value 7 at 1.1",
        "later 5 at 2.1",
        "again 1 at 2.1",
        "in vain 1 at 2.2",
        "same thread 1 at 2.2",
    ]
    assert said[-1].startswith("hash")
    again = run_model(MODEL, "threads.cpp", out="again")
    assert said == [one.text for one in again.of(Text) if one.source == "threads"], "ids are no addresses"
    [failure] = outcome.of(Failure)
    assert "on purpose" in failure.what
