"""What CPython's operations take on the machine that they were measured on: ``python.yaml``.

Law: time of code = sum over its operations of (how often, counted as it runs) x (nanoseconds of one). What an
operation takes depends on what stands beside it and on the types of its operands, which the law leaves out:
that is its error. Operations take longer in programs than alone in a loop, where a processor foresees every
branch; ``in_context`` is by how much, and is in the nanoseconds already.

Other processors are reached by one factor, in ``code``.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from ruamel.yaml import YAML

from volery.cost.figure import Stated

STEPS_PER_NS = 10
"""Counting is in whole steps: tenths of a nanosecond on the machine of the table."""


class OperationTable(Stated):
    """Nanoseconds by the name of an operation, for one interpreter on one machine.

    ``mean_error`` and ``worst_error`` are relative, over *programs* that the table was not made from.
    """

    interpreter: str
    machine: str
    in_context: float
    programs: int
    mean_error: float
    worst_error: float
    nanoseconds: Mapping[str, float]


@cache
def python_operations() -> OperationTable:
    """The table that counted Python is priced by. It was measured on a server processor."""
    text = files("volery.cost").joinpath("python.yaml").read_text(encoding="utf-8")
    return OperationTable.model_validate(YAML(typ="safe").load(text))
