"""Library calls in counted code: which are found, what they cost, and that nothing else changes."""

from __future__ import annotations

import ast
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from volery.autonomy.laser_scan import LaserScan2
from volery.calibration.timed_code import timed_program
from volery.cost import STEPS_PER_NS, LibraryTable, StepCounter, library_table, operation_table
from volery.cost.library_calls import LibraryCall
from volery.cost.library_sizes import call_feature, call_size, new_pages

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
    """Without the table less than half of their time is found; see bench/library_calls.py."""
    one = timed_program(program, (PROGRAMS / f"{program}.py").read_text(encoding="utf-8"), 5)
    plain = one.counted_ns(operation_table().nanoseconds)
    whole = one.counted_ns(operation_table().nanoseconds, library_table())
    assert plain < 0.5 * whole
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


def numpy_ns(setup: str, statement: str) -> float:
    """Return what a statement costs in calls of numpy, ns."""
    whole, before = (
        executed(f"import numpy as np\n{setup}\n{text}\n")[1].libraries for text in (statement, "pass")
    )
    assert whole is not None
    assert before is not None
    return (whole.steps.get("numpy", 0) - before.steps.get("numpy", 0)) / STEPS_PER_NS


@pytest.mark.parametrize(
    "statement",
    ["b = 2.0 * a", "b = 1.0 - a", "b = -a", "b = ~(a > 0.5)", "a += 1.0", "a[10:] *= a[:-10]", "a[:] = 3.0"],
)
def test_every_form_of_an_operation_on_an_array_is_priced(statement: str) -> None:
    small, large = (numpy_ns(f"a = np.zeros({size})", statement) for size in (20, 200_000))
    assert small > 50.0
    assert large > 50.0 * small


def test_a_store_through_a_mask_is_priced_by_the_mask() -> None:
    single = numpy_ns("a = np.zeros(40_000)\nm = 7", "a[m] = 1.0")
    nothing = numpy_ns("a = np.zeros(40_000)\nm = a > 1.0", "a[m] = 1.0")
    half = numpy_ns("a = np.zeros(40_000)\nm = np.arange(40_000) % 2 == 0", "a[m] = 1.0")
    assert half > 10.0 * nothing > 50.0 * single > 0.0
    assert numpy_ns("a = np.zeros(40_001)\nm = np.arange(40_000) % 2 == 0", "a[1:][m] = a[1:][m]") > half


@pytest.mark.parametrize(
    ("feature", "arguments", "result", "count"),
    [
        ("loops", (np.ones((50, 4)), np.ones((50, 4))), np.ones((50, 4)), 0),
        ("loops", (np.ones((50, 4)), np.ones(4)), np.ones((50, 4)), 49),
        ("loops", (np.ones((6, 1, 3)), np.ones((1, 5, 3))), np.ones((6, 5, 3)), 29),
        ("loops", (np.ones((50, 4)),), np.ones(50), 49),
        ("loops", (np.ones((50, 4)),), 200.0, 0),
        ("loops", (np.ones((50, 4))[:, 1:],), np.ones((50, 3)), 49),
        ("loops", (np.ones(50), 2.0), np.ones(50), 0),
        ("strided", (np.ones((50, 4))[:, 1],), np.ones(50), 50),
        ("cast", (np.ones(50), np.ones(50, dtype="i4")), np.ones(50), 50),
        ("cast", (np.ones(50), np.ones(50, dtype="i4")), np.ones(50, dtype="?"), 50),
        ("cast", (np.ones(50), np.ones(50)), np.ones(50, dtype="?"), 0),
        ("selected", (np.ones(50, dtype="?"),), None, 50),
        ("rows", (np.arange(7),), np.ones((7, 3)), 7),
        ("coordinates", (np.ones((6, 7), dtype="?"),), (np.arange(42), np.arange(42)), 42),
        ("values", ('{"a": [1, 2]}',), {}, 2),
        ("decimals", ("[1.25, 10.5]",), [], 5),
        ("scanned", (r"(\d+)x", "abc"), [], 3),
        ("scanned", ("unit=", "abc"), [], 0),
    ],
)
def test_features_of_calls(feature: str, arguments: tuple[object, ...], result: object, count: float) -> None:
    assert call_feature(feature, arguments, result) == count


def test_features_add_to_the_price_of_a_size() -> None:
    law = LibraryCall(size="items", points={10: 100.0}, each={"loops": 5.0, "wrapped": 40.0})
    table = np.ones((10, 2))
    assert law.of_call((table,), table.sum(axis=1)) == 100.0 + 9 * 5.0
    assert law.of_call((table,), 20.0, wrapped=True) == 140.0
    with pytest.raises(ValueError, match="feature 'luck'; there is loops"):
        LibraryCall(size="items", points={1: 1.0}, each={"luck": 1.0})


def test_large_new_arrays_cost_their_pages() -> None:
    assert new_pages(np.ones(60_000)) == 117
    assert new_pages(np.ones(60_000)[1:]) == new_pages(np.ones(1000)) == new_pages(3.0) == 0


def test_stores_change_nothing_and_read_their_target_once_where_it_matters() -> None:
    module, _ = executed(
        "import numpy as np\n"
        "calls = []\n"
        "def which():\n    calls.append(1)\n    return 1\n"
        "class Holder:\n    pass\n"
        "h = Holder()\nh.x = np.zeros(4)\nh.x[1:3] += 2.0\nh.x += 1.0\n"
        "a = np.arange(6.0).reshape(2, 3)\na[which()] = 7.0\na[which(), 2] -= 1.0\na[1:][a[1:] > 6.5] = 0.0\n"
        "words = {'n': 1}\nwords['n'] += 1\nwords['m'] = [0]\nwords['m'][0] -= 5\nx, y = 1, 2\ny += x\n"
    )
    assert module.calls == [1, 1]
    assert module.h.x.tolist() == [1.0, 3.0, 3.0, 1.0]
    assert module.a.tolist() == [[0.0, 1.0, 2.0], [0.0, 0.0, 6.0]]
    assert (module.words, module.y) == ({"n": 2, "m": [-5]}, 3)


def test_sums_of_narrow_types_take_their_time_by_bytes() -> None:
    wide, narrow = (numpy_ns(f"a = np.ones(65536, dtype='{kind}')", "b = a + a") for kind in ("f8", "u1"))
    assert wide > 5.0 * narrow
    assert numpy_ns("a = np.ones(65536)", "b = a ** 2") < 0.5 * numpy_ns("a = np.ones(65536)", "b = a ** a")


def test_functions_without_points_are_priced_by_one_that_computes_alike() -> None:
    setup = "a = np.ones(40_000)"
    assert numpy_ns(setup, "b = np.log(a)") == numpy_ns(setup, "b = np.exp(a)")
    assert numpy_ns(setup, "b = np.negative(a)") == numpy_ns(setup, "b = np.add(a, a)")


def test_sizes_of_records_and_packed_text() -> None:
    assert call_size("squares", (np.ones((50, 4)), np.ones(50)), ()) == 800.0
    assert call_size("squares", ([1.0, 2.0],), ()) == 2.0
    assert call_size("fields", (1, 2.0, 3), b"...") == 3.0
    assert call_size("fields", (b"....",), (1, 2, 3, 4)) == 4.0
    assert call_feature("part packed", (bytes(800),), bytes(400)) == 800.0
    assert call_feature("part packed", (bytes(800),), bytes(800)) == 0.0
    _, counter = executed(
        "import struct\nb = struct.pack('<3d', 1.0, 2.0, 3.0)\nc = struct.unpack('<3d', b)\n"
    )
    assert counter.libraries is not None
    assert 100.0 < counter.libraries.steps["struct"] / STEPS_PER_NS < 2000.0
    assert not counter.libraries.unpriced


SLAM = """
import numpy as np
from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.planar_pose import Pose2
from volery.autonomy.slam import Slam
corner = np.stack((np.linspace(-2.0, 2.0, COUNT), np.full(COUNT, 1.5)), axis=1)
slam, empty = Slam(), corner[:0]
def run():
    for number in range(3):
        slam.add(Pose2(0.01 * number, 0.0, 0.0), LaserScan2(number, corner, empty))
"""


def test_a_call_of_volery_is_charged_by_its_work_once() -> None:
    spent = {}
    for count in (50, 400):
        module, counter = executed(SLAM.replace("COUNT", str(count)))
        assert counter.libraries is not None
        of_numpy, plain = counter.libraries.steps["numpy"], counter.take()
        module.run()
        spent[count] = counter.libraries.steps["autonomy"]
        assert counter.libraries.steps["numpy"] - of_numpy < 100, "numpy inside belongs to the call"
        assert spent[count] < counter.take() < spent[count] + 20_000 * STEPS_PER_NS
        assert plain > 0
        assert not any(name.startswith("autonomy") for name in counter.libraries.unpriced)
    assert spent[400] > 1.5 * spent[50]


def test_a_method_of_a_class_that_extends_one_of_volery_is_charged_too() -> None:
    module, counter = executed(
        "from volery.autonomy.slam import Slam\nfrom volery.autonomy.planar_pose import Pose2\n"
        "class Mine(Slam):\n    pass\n"
        "def run(scan):\n    Mine().add(Pose2(), scan)\n"
    )
    assert counter.libraries is not None
    points = np.stack((np.linspace(0.0, 3.0, 200), np.ones(200)), axis=1)
    module.run(LaserScan2(0, points, points[:0]))
    assert counter.libraries.steps["autonomy"] > 50_000 * STEPS_PER_NS


def test_functions_of_opencv_are_found_although_they_do_not_say_where_they_belong() -> None:
    spent = {}
    for side in (60, 600):
        _, counter = executed(
            f"import cv2\nimport numpy as np\npicture = np.zeros(({side}, {side}), np.uint8)\n"
            "cv2.Canny(picture, 50, 150)\ncv2.GaussianBlur(picture, (5, 5), 1.0)\n"
            "family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)\n"
            "cv2.aruco.ArucoDetector(family).detectMarkers(picture)\n"
        )
        assert counter.libraries is not None
        spent[side] = counter.libraries.steps["cv2"]
        assert set(counter.libraries.unpriced) <= {"cv2.getPredefinedDictionary", "cv2.ArucoDetector"}
    assert spent[600] > 2 * spent[60]
