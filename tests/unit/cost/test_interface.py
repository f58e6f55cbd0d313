"""Other packages use cost through its two interfaces, ``volery.cost`` and ``volery.cost.native``."""

import ast
from pathlib import Path

import pytest

import volery
from volery.base.errors import EstimateError
from volery.cost import Price, ProcessorPrices, StatedCost, load_catalogue

SOURCES = Path(volery.__file__).parent
MHZ = 1e6


def imported_modules(file: Path) -> set[str]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module}


def test_no_package_imports_a_module_of_cost():
    found = {
        f"{file.relative_to(SOURCES)}: {module}"
        for file in SOURCES.rglob("*.py")
        if "cost" not in file.relative_to(SOURCES).parts[:1]
        for module in imported_modules(file)
        if module.startswith("volery.cost.") and module != "volery.cost.native"
    }
    assert found == set()


def prices(kind: str = "rpi4-cortex-a72", frequency_mhz: float = 600.0) -> ProcessorPrices:
    return ProcessorPrices("board", load_catalogue().processor(kind), frequency_mhz * MHZ)


def test_a_stated_figure_is_scaled_from_the_nearest_frequency():
    kind = "rpi4-cortex-a72"
    figures = (
        StatedCost(kind, 1200 * MHZ, 1000, 0.5),
        StatedCost(kind, 1500 * MHZ, 1),
        StatedCost("other", 1, 1),
    )
    stated = prices(kind).stated("planner", {"plan": figures}, ())
    cost = stated.operation("planner", "plan")
    assert cost.time == 2000
    assert 0.0 < cost.energy < 0.5
    with pytest.raises(EstimateError, match="no time is stated for an activation"):
        stated.activation("planner")


def test_a_figure_for_another_kind_of_processor_is_an_error():
    with pytest.raises(
        EstimateError, match=r"planner: the time of 'plan' is stated for other, .* to board, of kind"
    ):
        prices().stated("planner", {"plan": (StatedCost("other", 1, 1),)}, ())


def test_counted_code_has_a_price_per_step_and_a_basis():
    slow, fast = prices(frequency_mhz=600.0), prices(frequency_mhz=1200.0)
    assert slow.python_code().ns_per_step == 2 * fast.python_code().ns_per_step
    assert slow.compiled_code().ns_per_step == 2 * fast.compiled_code().ns_per_step
    assert [basis.law for basis in slow.code_basis()] == ["counted python code on rpi4-cortex-a72"]
    assert slow.compiled_code_basis().provenance == "estimated"
    with pytest.raises(EstimateError, match="outside the range of its laws"):
        prices(frequency_mhz=3000.0).compiled_code()


def test_calls_into_ros_and_power_have_prices_and_bases():
    board = prices()
    assert board.ros_calls("roscpp") is board.ros_calls("roscpp")
    assert isinstance(board.ros_calls("roscpp")("publish", 1.0), Price)
    assert board.watts(1.0) > board.watts(0.0)
    [ros], [power] = board.ros_basis(), board.power_basis()
    assert (ros.law, power.law) == ("roscpp calls on rpi4-cortex-a72", "power of rpi4-cortex-a72")
    assert "paper" in ros.source
