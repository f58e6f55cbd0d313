"""What of a model goes where on a real graph, and what travels between processes."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from volery.base.errors import CapabilityError, UsageError
from volery.base.position import AMSL, Position
from volery.components.loader import Loader
from volery.model.reader import load
from volery.model.system import System
from volery.run.assembly.vocabulary import vocabulary
from volery.run.distributed import pipe, plan
from volery.run.distributed.remote_ports import ValueCodec

DELIVERY = Path(__file__).parents[4] / "examples" / "delivery"
TYPES = """
from dataclasses import dataclass
from enum import Enum

from volery import Position

class Stage(Enum):
    LOADING = "loading"

@dataclass(frozen=True)
class Status:
    where: Position
    stage: Stage
    jobs: tuple
    notes: dict
"""


@pytest.fixture(scope="module")
def delivery() -> System:
    return load(DELIVERY, vocabulary(), "pocket")


def test_the_application_gets_processes_and_the_environment_stays_with_the_world(delivery: System) -> None:
    apart = [one.name for one in plan.worker_instances(delivery)]
    assert {"central", "planner", "drone_control_1", "landing_2", "rover_control_east"} <= set(apart)
    assert not {"requesters", "provider", "beacon_1", "beacon_2"} & set(apart)


def test_a_language_that_cannot_be_a_process_yet_is_named(delivery: System) -> None:
    first = delivery.instances[0]
    foreign = replace(first, component=replace(first.component, language="rclcpp"))
    with pytest.raises(CapabilityError, match=f"{first.name}: a component in rclcpp"):
        plan.worker_instances(replace(delivery, instances=(foreign, *delivery.instances[1:])))


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


@pytest.fixture
def shared(tmp_path: Path) -> tuple[ModuleType, ValueCodec]:
    """A module beside the components' files, and the values of a process that knows it."""
    (tmp_path / "station_types.py").write_text(TYPES)
    loader = Loader()
    module = loader.sibling("station_types", tmp_path)
    assert module is not None
    return module, ValueCodec(lambda name: loader.sibling(name, tmp_path))


def test_values_arrive_as_they_were(shared: tuple[ModuleType, ValueCodec]) -> None:
    module, values = shared
    where = Position(43.47, -3.83, AMSL(25.5))
    status = module.Status(where, module.Stage.LOADING, (1, "a", None), {"!": [2.5, True], "b": {3: ()}})
    asked = [[status, float("inf"), ["x", (where,)]], {"note": "ä"}]
    assert values.from_text(values.to_text(asked, "it")) == asked


class Unknown:
    pass


class Colour(Enum):
    RED = 1


@dataclass
class Ours:
    x: int


@pytest.mark.parametrize("value", [Unknown(), {1, 2}, b"bytes", Ours(1), Colour.RED, Position, print])
def test_what_cannot_leave_its_process_is_named(value: Any, shared: tuple[ModuleType, ValueCodec]) -> None:
    with pytest.raises(UsageError, match=r"the result of a\.b: a \w+ cannot be sent to another process"):
        shared[1].to_text([value], "the result of a.b")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        '{"!": "os:system", "value": {}}',
        '{"!": "volery.base.position:Position", "value": {"latitude": 1.0}}',
        '{"!": "volery.base.position:isfinite", "value": 1}',
        '{"!": "volery.user.shared.nothing:Status", "value": {}}',
        '{"!": "volery.user.shared.station_types:Stage", "value": "EATING"}',
        '{"!": "volery.base.errors:UsageError", "value": {}}',
    ],
)
def test_nothing_is_made_of_what_makes_no_sense(text: str, shared: tuple[ModuleType, ValueCodec]) -> None:
    with pytest.raises(UsageError, match="not the value of a port"):
        shared[1].from_text(text)


def test_a_pipe_delivers_messages_in_order_until_its_end() -> None:
    ours, (theirs_in, theirs_out) = pipe.Pipe.pair()
    theirs = pipe.Pipe(theirs_in, theirs_out)
    assert ours.send(pipe.Begin())
    assert ours.send(pipe.TruthReply(Position(1.0, 2.0, AMSL(3.0))))
    assert theirs.receive() == pipe.Begin()
    assert theirs.receive() == pipe.TruthReply(Position(1.0, 2.0, AMSL(3.0)))
    os.write(theirs_out, b"half a pickle")
    theirs.close()
    with pytest.raises(EOFError):
        ours.receive()
