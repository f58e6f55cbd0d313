"""Parameters: one, all, and those that lie in the bytes of a float."""

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.time import S
from volery.links.mavlink_messages import to_bytewise

REAL32, INT32 = 9, 6
KEPT: dict[str, tuple[int, float]] = {
    "ARMING_CHECK": (INT32, 1.0),
    "RTL_ALT": (REAL32, 15.5),
    "SYSID": (INT32, -3.0),
}


def serve(rig: Any, bytewise: bool = False, lost: Callable[[str], bool] = lambda name: False) -> None:
    """Answer as an autopilot that keeps ``KEPT``; *lost*: what gets lost when all are listed."""
    names = list(KEPT)

    def publish(name: str) -> None:
        kind, value = KEPT[name]
        written = to_bytewise(kind, value) if bytewise else value
        about = {"param_index": names.index(name), "param_count": len(names), "param_type": kind}
        rig.emit("PARAM_VALUE", param_id=name, param_value=written, **about)

    def listed(fields: dict[str, Any]) -> None:
        for name in names:
            if not lost(name):
                publish(name)

    def read(fields: dict[str, Any]) -> None:
        name = fields["param_id"] or names[fields["param_index"]]
        if name in KEPT:
            publish(name)

    def written(fields: dict[str, Any]) -> None:
        rig.emit("PARAM_VALUE", **{key: fields[key] for key in ("param_id", "param_value", "param_type")})

    rig.answers.update({"PARAM_REQUEST_LIST": listed, "PARAM_REQUEST_READ": read, "PARAM_SET": written})


@pytest.mark.parametrize("autopilot", [3, 12])
@pytest.mark.parametrize(("name", "integer", "real"), [("SYSID", -3, 0.0), ("RTL_ALT", 0, 15.5)])
def test_one_is_read(rig: Any, autopilot: int, name: str, integer: int, real: float) -> None:
    """PX4 puts whole numbers into the bytes of the float."""
    rig.heartbeat(autopilot=autopilot)
    rig.run(S)
    serve(rig, bytewise=autopilot == 12)
    answer = rig.call("param/get", "mavros_msgs/ParamGet", param_id=name)
    assert (answer.success, answer.value.integer, answer.value.real) == (True, integer, real)


@pytest.mark.parametrize(("autopilot", "sent"), [(3, 7.0), (12, to_bytewise(INT32, 7.0))])
def test_one_is_set(rig: Any, autopilot: int, sent: float) -> None:
    rig.heartbeat(autopilot=autopilot)
    rig.run(S)
    serve(rig, bytewise=autopilot == 12)
    answer = rig.call(
        "param/set", "mavros_msgs/ParamSet", param_id="SYSID", value={"integer": 7, "real": 0.0}
    )
    assert (answer.success, answer.value.integer) == (True, 7)
    [asked] = rig.asked("PARAM_SET")
    assert (asked["param_id"], asked["param_value"], asked["param_type"]) == ("SYSID", sent, INT32)


def test_all_are_pulled_and_those_that_were_changed_are_pushed(rig: Any) -> None:
    rig.connect()
    serve(rig, lost=lambda name: name == "RTL_ALT")  # asked for once more by its index
    received = rig.listen("param/param_value", "mavros_msgs/Param")
    answer = rig.call("param/pull", "mavros_msgs/ParamPull", force_pull=True)
    assert (answer.success, answer.param_received) == (True, 3)
    assert {message.param_id for message in received} == set(KEPT)
    got = rig.user.get_parameter("/drone_1/param")
    assert got == {"ARMING_CHECK": 1, "RTL_ALT": 15.5, "SYSID": -3}
    rig.user.set_parameter("/drone_1/param/RTL_ALT", 20.0)
    answer = rig.call("param/push", "mavros_msgs/ParamPush")
    assert (answer.success, answer.param_transfered) == (True, 1)
    assert [(one["param_id"], one["param_value"]) for one in rig.asked("PARAM_SET")] == [("RTL_ALT", 20.0)]


def test_what_is_known_is_not_asked_for_again(rig: Any) -> None:
    rig.connect()
    serve(rig)
    rig.call("param/pull", "mavros_msgs/ParamPull", force_pull=True)
    rig.sent.clear()
    answer = rig.call("param/pull", "mavros_msgs/ParamPull", force_pull=False)
    assert (answer.success, answer.param_received) == (True, 3)
    assert rig.asked("PARAM_REQUEST_LIST") == []


def test_no_answer_is_no_success(rig: Any) -> None:
    rig.connect()
    answer = rig.call("param/pull", "mavros_msgs/ParamPull", force_pull=True)
    assert (answer.success, answer.param_received) == (False, 0)


def test_what_is_never_answered_does_not_hold_up_for_long(rig: Any) -> None:
    rig.connect()
    serve(rig, lost=lambda name: name != "SYSID")
    del rig.answers["PARAM_REQUEST_READ"]
    start = rig.kernel.now()
    answer = rig.call("param/pull", "mavros_msgs/ParamPull", force_pull=True)
    assert (answer.success, answer.param_received) == (False, 1)
    assert rig.kernel.now() - start < 6 * S
