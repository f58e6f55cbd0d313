"""A real stage: what a check waits for is seconds of the vehicle."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from volery.base.time import MS, S, to_seconds
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.testing.stage import RealStage
from volery.vehicles.telemetry import Telemetry


@pytest.mark.parametrize(("rate", "taken"), [(1.0, 6.0), (3.0, 2.0), (0.5, 12.0)])
def test_a_sleep_is_in_seconds_of_the_vehicle(rate: float, taken: float) -> None:
    kernel = VirtualKernel()
    stage: Any = RealStage.__new__(RealStage)
    seen = Telemetry(kernel, "fast")
    stage.kernel, stage.drone = kernel, SimpleNamespace(telemetry=seen)
    woken: list[float] = []

    def report() -> None:
        seen.note_message(kernel.now())
        seen.update_clock(round(rate * kernel.now()))

    def check() -> None:
        stage.sleep(6.0)
        woken.append(to_seconds(kernel.now()))

    kernel.every(20 * MS, report)
    kernel.call_at(20 * S, lambda: kernel.spawn(check, "check", ExecutionContext("check")))
    kernel.run(40 * S)
    kernel.close()
    assert woken == [pytest.approx(20.0 + taken, abs=0.11)]
