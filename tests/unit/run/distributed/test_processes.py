"""Nodes that do not join a real graph by the deadline are reported by name."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any, cast

import pytest

from volery.base.errors import LinkSilent
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.transports.client_library import pending_calls, run_in_thread
from volery.run.distributed import processes
from volery.run.distributed.processes import DistributedRun, GraphSettings


def run_with(kernel: VirtualKernel) -> Any:
    """A run on a graph, without its graph: what ``go`` reads of it."""
    return cast(
        "Any", SimpleNamespace(_kernel=kernel, _settings=GraphSettings("ros1", 1.0, 1), _processes=[])
    )


def test_the_nodes_that_do_not_join_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    release = threading.Event()
    kernel = VirtualKernel()
    kernel.spawn(
        lambda: run_in_thread(kernel, "join", release.wait),
        "drone_1/mavros",
        ExecutionContext("x"),
        kernel.root,
    )
    monkeypatch.setattr(processes, "JOIN_WITHIN_S", 0.1)
    with pytest.raises(LinkSilent, match=r"not on the graph within 0.1 s: drone_1/mavros; check that ros1"):
        DistributedRun.go(run_with(kernel))
    release.set()
    monkeypatch.setattr(processes, "JOIN_WITHIN_S", 30.0)
    DistributedRun.go(run_with(kernel))
    assert pending_calls(kernel) == ()
    kernel.close("the test is over")
