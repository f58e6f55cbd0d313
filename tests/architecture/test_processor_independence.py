"""Mathematics of the C library, whose last bit depends on the processor, is kept out of what is traced."""

from __future__ import annotations

from types import ModuleType

import pytest


@pytest.mark.parametrize(
    ("source", "function"),
    [
        ("from math import pi, sin\n", "sin"),
        ("import math\nx = math.atan2(1.0, 2.0)\n", "atan2"),
        ("def f(x: float) -> float:\n    return x**2\n", "**"),
        ("x = 0.98**400\n", "**"),
    ],
)
def test_each_use_is_named_with_its_line(script: ModuleType, source: str, function: str) -> None:
    [(line, found)] = script.depends_on_processor(source)
    assert found == function
    assert line == source.count("\n")


def test_what_rounds_correctly_passes(script: ModuleType) -> None:
    source = "from math import hypot, radians, sqrt\nx = 2**63 - 10**9 + sqrt(2.0) * hypot(3.0, 4.0)\n"
    assert list(script.depends_on_processor(source)) == []


def test_the_check_reads_the_package(script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    assert list(script.processor_independence()) == []
    monkeypatch.setattr(script, "UNTRACED", ())
    assert any("control/tuning.py" in line for line in script.processor_independence())
