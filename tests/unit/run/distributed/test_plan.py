"""Which process runs which part of a model on a real graph."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from volery.model.system import System
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary
from volery.run.distributed import plan

DELIVERY = Path(__file__).parents[4] / "examples" / "delivery"


@pytest.fixture(scope="module")
def delivery() -> System:
    return load(DELIVERY, vocabulary(), "pocket")


def test_the_application_gets_processes_and_the_environment_stays_with_the_world(delivery: System) -> None:
    apart = [one.name for one in plan.worker_instances(delivery)]
    assert {"central", "planner", "drone_control_1", "landing_2", "rover_control_east"} <= set(apart)
    assert not {"requesters", "provider", "beacon_1", "beacon_2"} & set(apart)


def test_requirements_about_the_models_computers_are_not_judged(delivery: System) -> None:
    left, unjudged = plan.without_computers(delivery)
    assert {one.name for one in left.requirements} >= {"delivered", "landing_offset_1", "battery_1"}
    assert set(unjudged) == {
        "landing_in_time_1",
        "landing_in_time_2",
        "control_in_time_1",
        "control_in_time_2",
    }
    assert left.processors == left.networks == ()


def test_an_operation_is_a_service_below_its_components_node(delivery: System) -> None:
    central = delivery.instance("central")
    assert plan.operations(delivery, central) == ("order",)
    assert plan.service_name(central, "order") == "/central/order"
    spaced = replace(central, name="my-central", namespace="/base")
    assert plan.service_name(spaced, "order") == "/base/my_central/order"
