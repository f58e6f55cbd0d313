"""An engine of campaigns that makes no runs: what a large table costs is measured with it."""

from __future__ import annotations

from concurrent.futures import Executor, Future
from typing import Any

import numpy as np

from volery.explore.executors import executors
from volery.explore.points import CampaignRow

OBSERVABLES = 51
"""As many as a run of the starter has."""


class Stub(Executor):
    """Stands for an engine: makes a row at once, of numbers that depend on the seed."""

    def __init__(self, address: str, workers: int) -> None:
        self.workers = workers or 2

    def submit(self, function: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
        (task,) = arguments
        future: Future[Any] = Future()
        values = np.random.default_rng(task.point.seed).random(OBSERVABLES)
        observables = {f"subject.quantity_{place}": float(one) for place, one in enumerate(values)}
        verdicts = {"landing": bool(values[0] < 0.97), "battery": True}
        future.set_result(
            CampaignRow(task.run, task.point, "completed", "", verdicts, observables, 100.0, 0.3, 0.3, "stub")
        )
        return future


executors.add("stub", Stub)
