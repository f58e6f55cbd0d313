"""Files written for rclcpp, unmodified, in virtual time."""

from __future__ import annotations

import pytest

from volery.base.errors import ModelError
from volery.trace.events import Charge, Text, Unserved

pytestmark = pytest.mark.integration

MODEL = """
volery: 1
name: nodes
components:
  Node:
    language: rclcpp
    path: PATH
    build: {flags: -O0}
    active: true
    at: {processor: intel-i5-3470, frequency: 3000 MHz}
    activation: {time: 10 us}
application: {node: {is: Node, SETTINGS}}
platform: {processors: {pc: {is: intel-i5-3470, frequency: 3000 MHz}}}
allocations: {only: {node: pc}}
run: {duration: 3 s}
"""


def model_of(path: str, settings: str = "namespace: /") -> str:
    return MODEL.replace("PATH", path).replace("SETTINGS", settings)


def said(outcome) -> list[str]:
    return [one.text for one in outcome.of(Text) if one.source == "node"]


FORMS = ["shared 7", "constant 7", "unique 7", "reference 7", "stamped 7", "member 7", "bytes 7"]


def test_forms_of_callbacks_parameters_lines_and_executors(run_model):
    settings = (
        "namespace: /robot, parameters: {speed: 2.5, label: model, gains: [1.0, 2.0], count: many}, "
        "arguments: [word, --ros-args, -p, level:=2]"
    )
    outcome = run_model(model_of("forms.cpp", settings), "forms.cpp")
    assert outcome.run.completed, outcome.run.record.outcome
    lines = said(outcome)
    first = [
        "/robot/forms with word",
        "names 0 2",
        "[true, false] [0, 0xff]",
        "speed 2.5 label own gains 2",
        "wrong type",
        "not declared",
        "level 4 1 ",
        "level 5 0 no five",
        "level 10 0 Parameter level out of range. Min: 0, Max: 9, value: 10",
        "1 4",
        "w 1 at 5.0",
        "can't compare times with different time sources",
    ]
    assert lines[: len(first)] == first
    rest = lines[len(first) :]
    assert sorted(line for line in rest if line in FORMS) == sorted(FORMS), "late subscriptions"
    others = [line for line in rest if line not in FORMS]
    assert others[:3] == [
        "SUCCESS (0) set",
        "TIMEOUT (2)",
        "Node '/robot/forms' has already been added to an executor.",
    ]
    assert set(others[3:-1]) == {"called back 1", "cancelled 1", "tick at 0.2", "tick at 0.5", "tick at 0.8"}
    assert others[-1] == "ok 0"
    kinds = {one.kind for one in outcome.of(Charge) if one.component == "node"}
    assert kinds >= {"ros:init", "ros:subscribe", "ros:advertise", "ros:publish", "ros:spin_once"}


def test_a_composition_without_main_and_a_deferred_answer(run_model):
    outcome = run_model(model_of("composed.cpp"), "composed.cpp")
    assert outcome.run.completed, outcome.run.record.outcome
    assert said(outcome) == ["asking: at last"]
    alone = model_of("composed.cpp", "node_name: mine").replace("path:", "class: Asking\n    path:")
    outcome = run_model(alone, out="alone")
    assert outcome.run.completed, outcome.run.record.outcome
    assert said(outcome) == []
    [unserved] = outcome.of(Unserved)
    assert unserved.name == "/ask"


def test_what_says_nothing_of_a_node_is_named(run_model, tmp_path):
    (tmp_path / "plain.cpp").write_text("#include <rclcpp/rclcpp.hpp>\n")
    with pytest.raises(ModelError, match=r"no main\(\) and no RCLCPP_COMPONENTS_REGISTER_NODE"):
        run_model(model_of("plain.cpp"))


def test_goals_of_an_action(run_model):
    outcome = run_model(model_of("goals.cpp"), "goals.cpp", "robot_msgs")
    assert outcome.run.completed, outcome.run.record.outcome
    assert said(outcome) == [
        *(
            "there 1",
            "rejected 1",
            "accepted 1",
            "at 1",
            "at 2",
            "at 3",
            "called back 3",
            "succeeded 1 with 3",
        ),
        *("cancelling 1", "cancelled 1 with 4", "Goal handle is not known to this client."),
    ]


def test_a_lifecycle_transforms_parameters_filters_diagnostics_and_events(run_model):
    outcome = run_model(model_of("managed.cpp"), "managed.cpp")
    assert outcome.run.completed, outcome.run.record.outcome
    lines = said(outcome)
    assert [line for line in lines if "requesting incompatible QoS" in line]
    assert [line for line in lines if "incompatible QoS" not in line] == [
        *("0 unconfigured", "from unconfigured", "1 inactive", "1 active", "heard 2"),
        "Caught exception in callback for transition deactivate: broken",
        *("0 unconfigured", "level 3", "event 4", "set 1 0, has 1 0"),
        *("camera at 4.0 yaw 1.571", "point 4.0 1.0 in world"),
        '"nowhere" passed to lookupTransform argument source_frame does not exist. '
        "There is base, camera or world",
        *("pair 1 10", "pair 3 20", "placed 1 at 6.0", "placed 2 at 7.0", "placed 3 at 8.0"),
        "cloud of 3 in world: 18, step 16, byte 13 is 7",
        *(" other: link 0 Node starting up 0", "board other: link 1 slow 2"),
        *("graph 1", "matched 1 of 1", "not DURABILITY_QOS_POLICY", "late 1", "matched 0 of 1"),
    ]
