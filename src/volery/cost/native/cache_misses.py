"""Where accesses that the first cache did not serve fall in the machine code that ran.

The trace has them by their number among the accesses of a block of intermediate code. The machine code of
that block has as many loads and stores, or some less (two at once) or more (what did not fit in registers): a
load falls on the load at the same share of the way through the block, a store on such a store.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from volery.cost.native import core_model
from volery.cost.native.instruction_tables import InstructionTables
from volery.cost.native.path_reconstruction import ExecutedPath

Array = np.ndarray[Any, np.dtype[Any]]


Row = tuple[int, int]
"""Of the table of instructions, in a step of what ran: (step, row)."""


def cache_misses(walked: ExecutedPath, encoded: InstructionTables, accesses_of: Sequence[int]) -> Array:
    """Rows of (step, row of the table of instructions, level, fetched ahead), in the order in which they run.

    *accesses_of*: how many each block has in the intermediate code.
    """
    found: list[tuple[int, int, int, int]] = []
    steps = sorted(
        (step for step, place in enumerate(walked.places) if place in walked.accesses),
        key=lambda step: (walked.places[step], step),
    )
    for place, steps_of in groupby(steps, key=lambda step: walked.places[step]):
        own = list(steps_of)
        ran_rows = [
            (step, row)
            for step in own
            for row in range(encoded.first[walked.pieces[step]], encoded.first[walked.pieces[step] + 1])
        ]
        loads, stores = (
            _those(ran_rows, encoded, core_model.LOAD),
            _those(ran_rows, encoded, core_model.STORE),
        )
        count = max(1, accesses_of[walked.owners[own[0]]])
        for one in walked.accesses[place]:
            rows = stores if one.store else loads
            if rows:
                step, row = rows[min(one.number * len(rows) // count, len(rows) - 1)]
                found.append((step, row, one.level, int(one.ahead)))
    return np.array(sorted(found), dtype=np.int64).reshape(-1, 4)


def _those(rows: Sequence[Row], encoded: InstructionTables, kind: int) -> list[Row]:
    """The rows that load, or those that store."""
    table = encoded.table
    return [
        (step, row)
        for step, row in rows
        if table[row, kind] >= 0 and table[row, core_model.KIND] == core_model.PLAIN
    ]
