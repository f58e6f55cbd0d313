"""What the driver takes for granted stands in the documentation, word for word."""

from __future__ import annotations

from pathlib import Path

from volery.vehicles.drivers.paparazzi.decoder import ASSUMED

PAGE = Path(__file__).parents[5] / "docs" / "paparazzi.md"


def test_every_assumption_is_in_the_table() -> None:
    lines = PAGE.read_text().splitlines()
    start = lines.index("| what | assumption |") + 2
    assert lines[start : start + len(ASSUMED)] == [f"| {what} | {text} |" for what, text in ASSUMED.items()]
