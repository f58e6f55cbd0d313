"""Library calls in counted code: which are found, what they cost, and that nothing else changes."""

from __future__ import annotations

import ast
from pathlib import Path
from types import ModuleType

import pytest

from volery.calibration.timed_code import timed_program
from volery.cost import STEPS_PER_NS, LibraryTable, StepCounter, library_table, operation_table
from volery.cost.library_calls import LibraryCall, call_size

PROGRAMS = Path(__file__).parents[3] / "bench" / "library_programs"


def executed(text: str) -> tuple[ModuleType, StepCounter]:
    counter = StepCounter(libraries=library_table())
    module = ModuleType("piece")
    tree = counter.instrument(ast.parse(text))
    vars(module).update(counter.names())
    exec(compile(tree, "piece", "exec"), vars(module))
    return module, counter


@pytest.mark.parametrize("program", sorted(file.stem for file in PROGRAMS.glob("*.py")))
def test_a_program_gives_the_same_and_most_of_its_time_is_in_libraries(program: str) -> None:
    """Without the table less than two fifths of their time is found; see bench/library_calls.py."""
    one = timed_program(program, (PROGRAMS / f"{program}.py").read_text(encoding="utf-8"), 5)
    plain = one.counted_ns(operation_table().nanoseconds)
    whole = one.counted_ns(operation_table().nanoseconds, library_table())
    assert plain < 0.4 * whole
    module, _ = executed((PROGRAMS / f"{program}.py").read_text(encoding="utf-8"))
    namespace: dict[str, object] = {}
    exec((PROGRAMS / f"{program}.py").read_text(encoding="utf-8"), namespace)
    assert module.run(module.prepare(3)) == namespace["run"](namespace["prepare"](3))  # type: ignore[operator]


def test_the_same_code_takes_the_same_time() -> None:
    text = "import numpy as np\nimport json\na = np.sort(np.ones(50) * 2)\nb = json.dumps(a.tolist())\n"
    assert len({executed(text)[1].take() for _ in range(3)}) == 1


def test_times_grow_with_sizes() -> None:
    found = {}
    for side in (10, 1000):
        _, counter = executed(f"import numpy as np\na = np.zeros(({side}, {side}))\nb = (a + 1.0)[2:, ::2]\n")
        assert counter.libraries is not None
        found[side] = counter.libraries.steps["numpy"] / STEPS_PER_NS
        assert counter.take() / STEPS_PER_NS >= found[side]
    assert found[1000] > 100 * found[10]


def test_all_kinds_of_expressions_give_what_they_gave() -> None:
    module, counter = executed(
        "import numpy as np\nimport json\n"
        "class Base:\n    def give(self):\n        return 2\n"
        "class Derived(Base):\n    def give(self):\n        return super().give() + 1\n"
        "a: 'np.ndarray[int]' = np.arange(12).reshape(3, 4)\n"
        "b = a[1:, ::2], a[..., 0], a[:, None].shape, [1, 2, 3][::-1], {'k': 5}['k'], 'abc'[1]\n"
        "c = a @ a.T, 1 < 2 < 3, a.sum(axis=0).tolist(), not (a > 3).any(), 2 ** 5, -7 // 2, 'x' * 3\n"
        "d = json.loads(json.dumps({'x': [1, 2.5]})), Derived().give(), sorted([3, 1], key=lambda x: -x)\n"
        "e = [*map(str, (1, 2))], max(*[1, 2]), dict(k=1, **{'m': 2}), sum(x for x in range(4))\n"
    )
    a = module.a
    assert [part.tolist() if hasattr(part, "tolist") else part for part in module.b] == [
        a[1:, ::2].tolist(), a[:, 0].tolist(), (3, 1, 4), [3, 2, 1], 5, "b",
    ]  # fmt: skip
    assert module.c[0].tolist() == (a @ a.T).tolist()
    assert module.c[1:] == (True, [12, 15, 18, 21], False, 32, -4, "xxx")
    assert module.d == ({"x": [1, 2.5]}, 3, [3, 1])
    assert module.e == (["1", "2"], 2, {"k": 1, "m": 2}, 6)
    assert counter.libraries is not None
    assert set(counter.libraries.steps) == {"numpy", "json"}


def test_functions_without_an_entry_are_named() -> None:
    _, counter = executed("import numpy as np\nnp.kron(np.eye(2), np.eye(2))\n")
    assert counter.libraries is not None
    assert counter.libraries.unpriced == {"numpy.kron": 1}


def test_files_without_such_libraries_are_left_alone() -> None:
    text = "import math\nx = math.sin(1.0) + [1, 2][0]\n"
    with_table, without = StepCounter(libraries=library_table()), StepCounter()
    trees = [one.instrument(ast.parse(text)) for one in (with_table, without)]
    assert ast.dump(trees[0]) == ast.dump(trees[1])


def test_the_law_between_and_beyond_its_points() -> None:
    law = LibraryCall(size="elements", points={10: 100.0, 1000: 10_000.0})
    assert law.nanoseconds(1) == 100.0
    assert law.nanoseconds(100) == pytest.approx(1000.0)
    assert law.nanoseconds(2000) == pytest.approx(20_000.0)
    assert call_size("text", ("abc", b"12345"), 1) == 5
    with pytest.raises(ValueError, match="size 'length'; there is elements"):
        LibraryCall(size="length", points={1: 1.0})


def test_a_table_is_written_as_it_is_read() -> None:
    assert LibraryTable.model_validate_json(library_table().as_text()) == library_table()
