"""The page about the four autopilots shows the mission that the examples fly."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "four-autopilots.md").read_text(encoding="utf-8")
LINES = 5


def mission_in(source: str) -> list[str]:
    (function,) = (one for one in ast.parse(source).body if isinstance(one, ast.FunctionDef))
    return [ast.unparse(line) for line in function.body]


def test_the_mission_is_the_examples_and_has_as_many_lines_as_the_page_says() -> None:
    shown = mission_in(PAGE.split("```python\n")[1].split("```")[0])
    assert shown == mission_in((ROOT / "examples" / "mission.py").read_text(encoding="utf-8"))
    assert len(shown) == LINES
    assert PAGE.count(f"` | {LINES} |") == len(("ardupilot", "px4", "paparazzi", "dji"))
