"""What is assumed of the firmware stands in the documentation, word for word."""

from __future__ import annotations

from pathlib import Path

from volery.simulation.autopilots.paparazzi.firmware import ASSUMED
from volery.simulation.autopilots.paparazzi.parameters import FIGURES

PAGE = Path(__file__).parents[5] / "docs" / "paparazzi.md"


def table_after(heading: str, head: str) -> list[str]:
    """The rows of the first table under a heading that begins with *head*."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    start = lines.index(head, lines.index(heading)) + 2
    rows = lines[start:]
    return rows[: next((place for place, row in enumerate(rows) if not row), len(rows))]


def test_every_assumption_is_in_the_table() -> None:
    expected = [f"| {what} | {text} |" for what, text in ASSUMED.items()]
    assert table_after("## The simulated Paparazzi", "| what | assumption |") == expected


def test_every_figure_is_in_the_table() -> None:
    expected = [f"| `{name}` | {one.value:g} | {one.what} |" for name, one in FIGURES.items()]
    assert table_after("## The simulated Paparazzi", "| figure | value | what |") == expected
