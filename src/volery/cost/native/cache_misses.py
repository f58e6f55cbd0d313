"""Positions of cache misses in the machine code that ran.

The trace has misses by the number of the access among those of its basic block in the intermediate code. The
machine code of the block has as many loads and stores, or fewer (two at once) or more (spilled registers): a
load is assigned to the load at the same share of the way through the block, a store to such a store.
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
"""(step of the path, row of the table of instructions)."""


def cache_misses(path: ExecutedPath, tables: InstructionTables, access_counts: Sequence[int]) -> Array:
    """Return the misses as rows (step, row of the table of instructions, level, fetched ahead), in order.

    Args:
        path: What ran.
        tables: The program's instructions.
        access_counts: Accesses of each basic block in the intermediate code.
    """
    found: list[tuple[int, int, int, int]] = []
    steps = sorted(
        (step for step, position in enumerate(path.positions) if position in path.accesses),
        key=lambda step: (path.positions[step], step),
    )
    for position, steps_here in groupby(steps, key=lambda step: path.positions[step]):
        own = list(steps_here)
        rows = [
            (step, row)
            for step in own
            for row in range(tables.first[path.blocks[step]], tables.first[path.blocks[step] + 1])
        ]
        loads = _rows_with(rows, tables, core_model.LOAD)
        stores = _rows_with(rows, tables, core_model.STORE)
        count = max(1, access_counts[path.owners[own[0]]])
        for access in path.accesses[position]:
            candidates = stores if access.store else loads
            if candidates:
                step, row = candidates[min(access.number * len(candidates) // count, len(candidates) - 1)]
                found.append((step, row, access.level, int(access.ahead)))
    return np.array(sorted(found), dtype=np.int64).reshape(-1, 4)


def _rows_with(rows: Sequence[Row], tables: InstructionTables, column: int) -> list[Row]:
    """Return the rows of ordinary instructions that load, or that store."""
    table = tables.table
    return [
        (step, row)
        for step, row in rows
        if table[row, column] >= 0 and table[row, core_model.KIND] == core_model.PLAIN
    ]
