"""What is timed for the table of library calls, and how loops become programs."""

from __future__ import annotations

import pytest

from volery.base.errors import UsageError
from volery.calibration.library_times import (
    COLD_NS,
    WARM,
    TimedCall,
    _of_feature,
    context_factors,
    features,
    in_context,
    measured_again,
    scaled,
    snippets,
)
from volery.calibration.picture_times import module_if_installed
from volery.calibration.timed_code import Rounds, TimedCode, timed_program
from volery.cost import WRAPPED, LibraryCall, LibraryTable, call_feature, library_table, operation_table

PROGRAMS = {
    "small": "import numpy as np\ndef prepare(seed):\n    return np.ones(1)\n"
    "def run(a):\n    for _ in range(50):\n        a = a * 1.5\n    return a\n",
    "large": "import numpy as np\ndef prepare(seed):\n    return np.ones(4000)\n"
    "def run(a):\n    for _ in range(50):\n        a = a * 1.5\n    return a\n",
    "huge": "import numpy as np\ndef prepare(seed):\n    return np.ones(60_000)\n"
    "def run(a):\n    for _ in range(5):\n        a = a * 1.5\n    return a\n",
}


def test_each_feature_is_priced_by_a_call_that_has_it_and_belongs_to_an_entry() -> None:
    entries = {one.name for one in snippets()}
    for one in features():
        assert one.name in entries
        if one.size != WRAPPED:
            assert call_feature(one.size, one.arguments, one.function(*one.arguments)) > 0, one[:2]


def test_all_entries_that_come_with_volery_can_be_measured_again() -> None:
    names, of_features = [one.name for one in snippets()], list(features())
    table = {
        name: one
        for name, one in library_table().calls.items()
        if module_if_installed(name.partition(".")[0])
    }
    assert set(names) == set(table)
    priced: dict[str, set[str]] = {}
    for one in of_features:
        priced.setdefault(one.name, set()).add(one.size)
    assert priced == {name: set(one.each) for name, one in table.items() if one.each}


def test_what_cannot_be_measured_by_itself_is_named() -> None:
    with pytest.raises(UsageError, match=r"library 'numpy' by itself; give .*cv2"):
        measured_again(library_table(), ["numpy"], Rounds(2, 2), lambda *_: None)


def test_a_feature_takes_what_a_call_takes_beyond_its_price(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TimedCall, "nanoseconds", lambda self: 700.0)
    law = LibraryCall(size="text", points={5: 100.0}, each={"lines": 999.0, "values": 50.0})
    one = TimedCall("json.loads", "lines", lambda text: None, ("a,\n\n\n",))
    assert _of_feature(one, law) == pytest.approx((700.0 - 100.0 - 50.0) / 3)
    assert _of_feature(one._replace(size=WRAPPED), law) == pytest.approx(700.0 - 100.0 - 50.0 - 3 * 999.0)


def test_the_part_that_does_not_grow_is_cold_and_the_rest_has_its_own_factor() -> None:
    calls = {
        "numpy.add": LibraryCall(
            size="items", points={1: 100.0, 1000: 400.0}, each={"loops": 2.0, "wrapped": 10.0}
        ),
        "numpy.cross": LibraryCall(size="items", points={1: 3000.0}),
        "json.loads": LibraryCall(size="text", points={1: 50.0}),
    }
    found = in_context(calls, 3.0, 2.0, "numpy")
    assert found["numpy.add"].points == {1: 300.0, 1000: 900.0}
    assert found["numpy.add"].each == {"loops": 4.0, "wrapped": 30.0}
    assert found["numpy.cross"].points[1] == pytest.approx(3000.0 + 2.0 * (COLD_NS + WARM * 2000.0))
    assert found["json.loads"] == calls["json.loads"]
    assert scaled(calls, 2.0)["numpy.add"].each == {"loops": 4.0, "wrapped": 20.0}


def test_the_factors_of_programs_are_found_again() -> None:
    loops = LibraryCall(size="elements", points={1: 200.0, 4000: 2000.0, 60_000: 30_000.0})
    table = LibraryTable(
        provenance="measured", source="made", validity="here", machine="none", programs=0, mean_error=0.0,
        worst_error=0.0, calls={"numpy.operator": loops},
    )  # fmt: skip
    real = table.model_copy(update={"calls": in_context(table.calls, 2.5, 1.5, "numpy"), "page": 300.0})
    programs: list[TimedCode] = []
    for name, text in PROGRAMS.items():
        one = timed_program(name, text)
        one.nanoseconds = [3.0 * one.counted_ns(operation_table().nanoseconds, real)] * 3
        programs.append(one)
    constant, growth, page = context_factors(programs, table, 3.0, "numpy")
    assert (constant, growth) == pytest.approx((2.5, 1.5), rel=0.01)
    assert page == pytest.approx(300.0, rel=0.02)
