"""The parameter store: order, types, overrides."""

from __future__ import annotations

import pytest

from volery.base.errors import UsageError
from volery.simulation.autopilots.autopilot_parameters import (
    INT8,
    INT16,
    INT32,
    REAL32,
    StoredParameter,
    VehicleParameters,
    quantised,
    single,
)

LISTED = (
    StoredParameter("B_FIRST", INT8, 1.0),
    StoredParameter("A_SECOND", REAL32, 0.5),
    StoredParameter("C_THIRD", INT16, 7.0),
)


def test_parameters_keep_their_order_and_index() -> None:
    store = VehicleParameters(LISTED)
    assert [one.name for one in store] == ["B_FIRST", "A_SECOND", "C_THIRD"]
    assert store.at(1) == LISTED[1]
    assert len(store) == 3


def test_a_changed_value_is_read_by_name_and_by_index() -> None:
    store = VehicleParameters(LISTED)
    assert store.set("C_THIRD", 12.0) == StoredParameter("C_THIRD", INT16, 12.0)
    assert store["C_THIRD"] == 12.0
    assert store.at(2).value == 12.0
    assert store.find("C_THIRD") == StoredParameter("C_THIRD", INT16, 12.0)


def test_two_vehicles_do_not_share_values() -> None:
    first, second = VehicleParameters(LISTED), VehicleParameters(LISTED)
    first.set("C_THIRD", 99.0)
    assert second["C_THIRD"] == 7.0


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_a_value_that_is_not_finite_changes_nothing(value: float) -> None:
    store = VehicleParameters(LISTED)
    assert store.set("A_SECOND", value) is None
    assert store["A_SECOND"] == 0.5


def test_unknown_names_are_none() -> None:
    store = VehicleParameters(LISTED)
    assert store.find("D_FOURTH") is None
    assert store.set("D_FOURTH", 1.0) is None
    assert "D_FOURTH" not in store


@pytest.mark.parametrize(
    ("kind", "given", "kept"),
    [
        (INT8, 1.4, 1.0),
        (INT8, 1000.0, 127.0),
        (INT16, -40_000.0, -32_768.0),
        (INT32, 3e9, 2_147_483_647.0),
        (REAL32, 0.1, single(0.1)),
    ],
)
def test_values_fit_their_types(kind: int, given: float, kept: float) -> None:
    assert quantised(kind, given) == kept


def test_an_override_replaces_the_default() -> None:
    assert VehicleParameters(LISTED, {"A_SECOND": 2.0})["A_SECOND"] == 2.0


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"A_SECONT": 1.0}, "no parameter 'A_SECONT'.*A_SECOND"),
        ({"A_SECOND": float("nan")}, "A_SECOND cannot be nan"),
        ({"B_FIRST": 1.5}, "B_FIRST cannot be 1.5: it is an integer from -128 to 127"),
        ({"B_FIRST": 300.0}, "B_FIRST cannot be 300"),
        ({"C_THIRD": 4.0}, "C_THIRD has no effect"),
    ],
)
def test_a_wrong_override_is_explained(overrides: dict[str, float], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        VehicleParameters(LISTED, overrides, supported=("A_SECOND", "B_FIRST"))


def test_a_parameter_without_effect_may_be_given_its_own_value() -> None:
    assert VehicleParameters(LISTED, {"A_SECOND": 0.5}, supported=())["A_SECOND"] == 0.5


SUBSYSTEM = (
    StoredParameter("GRIP_ENABLE", INT8, 0.0),
    StoredParameter("GRIP_GRAB", INT16, 1900.0, "GRIP_ENABLE"),
    StoredParameter("LAST", INT8, 3.0),
)


def test_parameters_of_a_subsystem_that_is_off_are_found_by_name_only() -> None:
    store = VehicleParameters(SUBSYSTEM)
    assert ([one.name for one in store], len(store)) == (["GRIP_ENABLE", "LAST"], 2)
    assert store.index("LAST") == 1
    assert "GRIP_GRAB" in store
    found = store.set("GRIP_GRAB", 1800.0)
    assert found is not None
    assert found.value == 1800.0
    assert store.find("GRIP_GRAB") == found
    assert len(store) == 2


def test_switching_a_subsystem_on_lists_its_parameters_at_once_and_off_hides_them() -> None:
    store = VehicleParameters(SUBSYSTEM)
    store.set("GRIP_ENABLE", 1.0)
    assert ([one.name for one in store], store.index("LAST")) == (["GRIP_ENABLE", "GRIP_GRAB", "LAST"], 2)
    store.set("GRIP_ENABLE", 0.0)
    assert ([one.name for one in store], store.at(1).name) == (["GRIP_ENABLE", "LAST"], "LAST")


def test_an_override_lists_a_subsystem_from_the_start() -> None:
    assert len(VehicleParameters(SUBSYSTEM, {"GRIP_ENABLE": 1.0})) == 3
