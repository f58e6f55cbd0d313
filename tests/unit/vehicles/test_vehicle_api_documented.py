"""The examples of docs/vehicle-api.md, executed as they are printed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[3] / "docs" / "vehicle-api.md"
EXAMPLES = re.findall(r"## ([^\n]+)\n(?:(?!\n## ).)*?```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)


def test_each_subject_has_its_example() -> None:
    assert len(EXAMPLES) == 6


@pytest.mark.parametrize("example", [one[1] for one in EXAMPLES], ids=[one[0] for one in EXAMPLES])
def test_an_example(example: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(example, str(PAGE), "exec"), {"__name__": "__main__"})
