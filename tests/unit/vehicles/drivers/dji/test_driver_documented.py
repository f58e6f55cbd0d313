"""What is assumed of a DJI aircraft stands in the documentation, word for word."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from volery.ros.messages.dji_constants import DocumentedBehaviour
from volery.simulation.autopilots.dji import firmware as simulated
from volery.simulation.autopilots.dji.parameters import SUPPORTED, parameters
from volery.vehicles.drivers.dji import driver

PAGE = Path(__file__).parents[5] / "docs" / "dji.md"


def table(heading: str, head: str) -> list[str]:
    """The rows of the first table after *heading* that begins with *head*."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    rows = lines[lines.index(head, lines.index(heading)) + 2 :]
    return rows[: rows.index("")]


@pytest.mark.parametrize(
    ("heading", "assumed"),
    [
        ("## What is taken for granted", driver.ASSUMED),
        ("## The simulated DJI", simulated.ASSUMED),
    ],
)
def test_every_assumption_is_in_a_table(heading: str, assumed: Mapping[str, str]) -> None:
    expected = [f"| {what} | {text} |" for what, text in assumed.items()]
    assert table(heading, "| what | assumption |") == expected


@pytest.mark.parametrize(
    ("heading", "documented"),
    [
        ("## What is taken for granted", driver.DOCUMENTED),
        ("## The simulated DJI", simulated.DOCUMENTED),
    ],
)
def test_every_documented_behaviour_is_in_a_table_with_its_source(
    heading: str, documented: Mapping[str, DocumentedBehaviour]
) -> None:
    expected = [f"| {subject} | {one.what} | {one.whom} |" for subject, one in documented.items()]
    assert table(heading, "| what | documented | by whom |") == expected


def test_every_figure_is_in_the_table() -> None:
    expected = [f"| `{one.name}` | {one.value:g} | {SUPPORTED[one.name]} |" for one in parameters()]
    assert table("## The simulated DJI", "| parameter | value | what it is |") == expected
