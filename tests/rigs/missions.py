"""A mission as a task of its own, in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.base.time import HOUR, Ns, S
from volery.kernel.task import ExecutionContext, Scope
from volery.kernel.virtual import VirtualKernel


def carried_out(
    kernel: VirtualKernel, mission: Callable[[], Any], scope: Scope | None = None, *, step: Ns = S
) -> Any:
    """What *mission* returns, or raises. *scope* ends with it."""
    outcome: list[Any] = []

    def body() -> None:
        try:
            outcome.append(mission())
        except Exception as error:
            outcome.append(error)
        if scope is not None:
            kernel.cancel(scope, "done")

    kernel.spawn(body, "mission", ExecutionContext("mission"), scope)
    until = kernel.now() + 2 * HOUR
    while not outcome and kernel.now() < until:
        kernel.run(kernel.now() + step)
    (found,) = outcome
    if isinstance(found, Exception):
        raise found
    return found


def stabilize_by_idle_throttle(drone: Any) -> None:
    """In the air it would fall."""
    drone.takeoff(10)
    drone.manual_control(0, 0, 0, 0)
    drone.stabilize()
