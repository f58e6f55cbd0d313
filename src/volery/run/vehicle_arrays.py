"""What a vehicle did in a run, as arrays: for numpy, pandas, and plots of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import S
from volery.trace.events import VehicleState
from volery.trace.reader import OpenTrace

TRACE = "trace.mcap"
INDEX = "time_s"


def vehicle_arrays(folder: Path | None, vehicle: str) -> dict[str, NDArray[Any]]:
    """Return the recorded states of one vehicle: an array for each field of ``VehicleState``.

    Positions are metres east, north, up of the origin of the run; ``time_s`` is seconds since its start.

    Args:
        folder: run folder.
        vehicle: name of the vehicle.

    Raises:
        UsageError: the run has kept no trace, or no such vehicle.
    """
    path = folder / TRACE if folder is not None else None
    if path is None or not path.exists():
        raise UsageError("this run has kept no trace; give it a folder: Options(out=Path('runs/mine'))")
    rows: list[VehicleState] = []
    names: set[str] = set()
    with OpenTrace(path) as reading:
        for event in reading.events(only=(VehicleState,)):
            if isinstance(event, VehicleState):
                names.add(event.vehicle)
                if event.vehicle == vehicle:
                    rows.append(event)
    if not rows:
        hint = did_you_mean(vehicle, names)
        raise UsageError(f"no vehicle {vehicle!r} in this run{hint}; there is {choices(names)}")
    times = np.array([row.at for row in rows]) / S
    fields = [field for field in VehicleState._fields if field not in {"at", "vehicle"}]
    return {INDEX: times, **{field: np.array([getattr(row, field) for row in rows]) for field in fields}}
