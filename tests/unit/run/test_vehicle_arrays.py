"""A run as numpy arrays and as a pandas data frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from volery.base.errors import UsageError
from volery.run.fly import fly
from volery.run.result import Options
from volery.vehicles import Drone


def hop(drone: Drone) -> None:
    drone.takeoff(4)
    drone.land()


def test_the_states_of_a_flight(tmp_path: Path) -> None:
    run = fly(hop, "sim:ardupilot", options=Options(out=tmp_path / "hop"))
    (name,) = run.record.vehicles
    arrays = run.arrays(name)
    assert arrays["time_s"].dtype == np.float64
    assert {len(column) for column in arrays.values()} == {len(arrays["time_s"])}
    assert arrays["z"].max() - arrays["z"].min() == pytest.approx(4.0, abs=0.7)
    frame = run.to_pandas(name)
    assert frame.index.name == "time_s"
    assert bool(frame["armed"].any())
    with pytest.raises(UsageError, match="no vehicle 'nobody' in this run; there is"):
        run.arrays("nobody")


def test_a_run_that_kept_nothing() -> None:
    run = fly(hop, "sim:ardupilot")
    with pytest.raises(UsageError, match="has kept no trace; give it a folder"):
        run.arrays("drone_1")
