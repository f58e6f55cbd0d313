from pathlib import Path
from typing import Any

import numpy as np
import pytest

from volery.base.errors import UsageError
from volery.ros import messages
from volery.ros.messages.store import store


@pytest.mark.parametrize("name", messages.types())
def test_every_type_starts_with_defaults_and_survives_its_bytes(name: str) -> None:
    fresh = messages.new(name)
    data = messages.to_cdr(fresh)
    assert len(data) == messages.cdr_size(fresh)
    assert messages.from_cdr(name, data) == fresh
    assert fresh.copy() == fresh


def test_a_size_follows_the_lengths_of_strings_and_lists() -> None:
    for text, numbers in (
        ("", []),
        ("map", [1.0]),
        ("Zürich", [1.0, 2.0]),
        ("map", [1.0] * 9),
        ("mapp", [1.0] * 9),
    ):
        joy = messages.new("sensor_msgs/Joy", header={"frame_id": text}, axes=numbers).copy()
        assert messages.cdr_size(joy) == len(messages.to_cdr(joy))
    listed = messages.new("diagnostic_msgs/DiagnosticArray")
    listed.status = [messages.new("diagnostic_msgs/DiagnosticStatus", name=name) for name in ("a", "motor")]
    assert messages.cdr_size(listed.copy()) == len(messages.to_cdr(listed))


@pytest.mark.parametrize("name", messages.service_types())
def test_every_service_has_a_request_and_a_response(name: str) -> None:
    kind = messages.service(name)
    for value in (kind.request(), kind.response()):
        assert messages.from_cdr(value.__msgtype__, messages.to_cdr(value)) == value


def test_both_spellings_of_a_name_are_one_class() -> None:
    assert messages.message_class("std_msgs/String") is messages.message_class("std_msgs/msg/String")
    assert messages.service("std_srvs/Trigger").name == "std_srvs/srv/Trigger"


def test_a_string_has_the_bytes_of_ros_2() -> None:
    assert messages.to_cdr(messages.new("std_msgs/String", data="hi")) == bytes.fromhex(
        "00010000 03000000 686900"
    )


def test_nested_fields_may_be_given_as_dicts() -> None:
    pose = messages.new(
        "geometry_msgs/PoseStamped", pose={"position": {"x": 1.5}}, header={"frame_id": "map"}
    )
    assert (pose.pose.position.x, pose.pose.position.y, pose.header.frame_id) == (1.5, 0.0, "map")


def test_defaults_are_fresh_for_each_message() -> None:
    one, other = messages.new("geometry_msgs/PoseStamped"), messages.new("geometry_msgs/PoseStamped")
    one.pose.position.x = 1.0
    assert other.pose.position.x == 0.0


def test_a_quaternion_starts_as_no_rotation() -> None:
    assert messages.new("geometry_msgs/Quaternion").w == 1.0


def test_a_copy_is_deep() -> None:
    original = messages.new("mavros_msgs/RCIn", channels=[1500, 1600], header={"frame_id": "a"})
    copied = original.copy()
    original.channels[0] = 1000
    original.header.frame_id = "b"
    assert list(copied.channels) == [1500, 1600]
    assert copied.channels.dtype == np.uint16
    assert copied.header.frame_id == "a"


def test_a_message_of_the_caller_alone_is_converted_in_place() -> None:
    own = messages.new("mavros_msgs/RCIn", channels=[1500, 1600])
    assert own.converted() is own
    assert own.channels.dtype == np.uint16
    channels = own.channels
    assert own.converted().channels is channels


@pytest.mark.parametrize("values", [[0.0] * 8, np.zeros(8), "nine"])
def test_a_conversion_finds_values_that_do_not_fit(values: object) -> None:
    fix = messages.new("sensor_msgs/NavSatFix", position_covariance=values)
    with pytest.raises(UsageError, match="position_covariance"):
        fix.converted()


def test_a_conversion_copies_messages_within_a_list() -> None:
    status = messages.new("diagnostic_msgs/DiagnosticStatus", name="motor")
    listed = messages.new("diagnostic_msgs/DiagnosticArray", status=[status])
    status_sent = listed.converted().status[0]
    status.name = "battery"
    assert status_sent.name == "motor"


def test_constants_are_attributes_of_the_class() -> None:
    assert messages.message_class("mavros_msgs/PositionTarget").FRAME_BODY_NED == 8
    assert messages.message_class("mavros_msgs/OverrideRCIn").CHAN_NOCHANGE == 65535


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (
            lambda: messages.new("std_msgs/Strin"),
            ["std_msgs/msg/Strin", "did you mean 'std_msgs/msg/String'"],
        ),
        (lambda: messages.new("no_msgs/Thing"), ["no_msgs/msg/Thing"]),
        (
            lambda: messages.new("std_msgs/String", dat="x"),
            ["std_msgs/msg/String", "dat", "did you mean 'data'"],
        ),
        (lambda: messages.service("std_srvs/Triger"), ["did you mean 'std_srvs/srv/Trigger'"]),
        (lambda: messages.to_cdr(messages.new("std_msgs/String", data=1)), ["data is 1", "string"]),
        (
            lambda: messages.to_cdr(messages.new("mavros_msgs/State", system_status=300)),
            ["system_status is 300"],
        ),
        (
            lambda: messages.to_cdr(messages.new("geometry_msgs/PoseStamped", pose=3)),
            ["pose is 3", "geometry_msgs/msg/Pose"],
        ),
        (
            lambda: messages.new("sensor_msgs/NavSatFix", position_covariance=[1.0]).copy(),
            ["position_covariance", "9 values"],
        ),
        (lambda: messages.new("mavros_msgs/RCIn", channels=[[1], [2]]).copy(), ["channels"]),
        (lambda: messages.from_cdr("std_msgs/String", b"abc"), ["std_msgs/msg/String", "3 bytes"]),
        (lambda: messages.define("std_msgs/String", "string data"), ["package/msg/Name"]),
        (lambda: messages.define("std_msgs/msg/String", "int32 data"), ["std_msgs/msg/String"]),
        (lambda: messages.define("my_msgs/msg/Broken", "what is this"), ["my_msgs/msg/Broken"]),
        (lambda: messages.define("my_msgs/srv/Broken", "int32 a"), ["---"]),
        (
            lambda: messages.define("my_msgs/msg/Wide", "wstring label"),
            ["Wide.label: wstring is not supported"],
        ),
    ],
)
def test_errors_name_the_offender(fault: object, words: list[str]) -> None:
    with pytest.raises(UsageError) as raised:
        fault()
    for word in words:
        assert word in str(raised.value)


def test_own_types_can_be_defined() -> None:
    messages.define("parcel_msgs/msg/Parcel", "uint32 FRAGILE=1\nstring good\nuint32 flags\n")
    messages.define("parcel_msgs/srv/Order", "Parcel parcel\n---\nbool accepted\n")
    kind = messages.service("parcel_msgs/Order")
    asked = kind.request(messages.new("parcel_msgs/Parcel", good="blood", flags=1))
    assert messages.from_cdr(asked.__msgtype__, messages.to_cdr(asked)).parcel.good == "blood"


def test_fields_may_have_the_names_of_methods() -> None:
    messages.define("parcel_msgs/msg/Print", "bool copy\nint32 converted\n")
    printed = messages.new("parcel_msgs/msg/Print", copy=True, converted=2)
    assert messages.from_cdr("parcel_msgs/msg/Print", messages.to_cdr(printed)) == printed
    assert (printed.copy, printed.converted) == (True, 2)


def test_constants_may_have_small_letters_as_in_ros_1() -> None:
    messages.define("mixed_msgs/msg/Mode", "uint8 kManual = 3\nuint8 A__B=4\nstring Name=a = b\nuint8 mode\n")
    kind: Any = messages.message_class("mixed_msgs/msg/Mode")
    assert (kind.kManual, kind.A__B, kind.Name, kind.__match_args__) == (3, 4, "a = b", ("mode",))


def test_parts_are_separated_by_any_line_of_three_dashes_or_more() -> None:
    messages.define("line_msgs/srv/Sync", "int8 x\n---- response\nint8 y\n")
    kind = messages.service("line_msgs/Sync")
    assert (kind.request.__match_args__, kind.response.__match_args__) == (("x",), ("y",))


def test_a_definition_holds_the_types_it_is_made_of() -> None:
    text = messages.definition("sensor_msgs/NavSatFix")
    assert "float64[9] position_covariance" in text
    assert "MSG: std_msgs/Header" in text
    assert "MSG: builtin_interfaces/Time" in text


FINGERPRINTS = {
    "mavros_msgs/msg/State": "11ba7686163d22281871f1cb42557e8957407469b0be813bdb1a8922c66e3131",
    "mavros_msgs/msg/PositionTarget": "594c39cea4484f1cb007adf04b29a78bae77f29358c974ea5e849542ed168303",
    "mavros_msgs/msg/StatusText": "d3420a07bd2d933d9c53b51d04ec59dc61a0ed04c7110a51996795a3cfde68b2",
    "mavros_msgs/msg/Waypoint": "1c0e12bd70ab8a12a5d6f2e6f9d9bb3aea0860d02bccc30ca8d9d6f5f4f30b94",
    "mavros_msgs/msg/OverrideRCIn": "e2fe61f060e059d9d2e0b4ed38d5779d88a365969d7d270e5e934c72c3637631",
    "geographic_msgs/msg/GeoPoseStamped": "a8e603c050fa992a74283bb462a96fe9d2b151b7a67b14d77250ed7cb4ed96b7",
}
"""ROS 2's type hashes (REP-2011) of the definitions of mavros_msgs 2 and geographic_msgs."""


@pytest.mark.parametrize(("name", "fingerprint"), FINGERPRINTS.items())
def test_definitions_are_those_of_ros(name: str, fingerprint: str) -> None:
    assert store().hash_rihs01(name) == f"RIHS01_{fingerprint}"


def test_times_reckon() -> None:
    time = messages.message_class("builtin_interfaces/Time")
    duration = messages.message_class("builtin_interfaces/Duration")
    later, earlier = time(5, 900_000_000), time(3, 0)
    assert later - earlier == duration(2, 900_000_000)
    assert earlier - later == duration(-3, 100_000_000)
    assert (earlier - later).to_sec() == -2.9
    assert later + duration(1, 200_000_000) == time(7, 100_000_000)
    assert duration(1, 0) + earlier == time(4, 0)
    assert later > earlier
    assert duration(3, 0) / duration(2, 0) == 1.5
    assert 2 * duration(1, 600_000_000) == duration(3, 200_000_000)
    assert -duration(0, 500_000_000) == duration(-1, 500_000_000)
    assert abs(-duration(0, 500_000_000)) == duration(0, 500_000_000)
    assert not duration()
    with pytest.raises(TypeError):
        later + earlier
    with pytest.raises(TypeError):
        duration(1, 0) - later


def test_ros_1_spelling_of_stamps_and_headers() -> None:
    header = messages.new("std_msgs/Header", stamp={"sec": 1, "nanosec": 2})
    assert (header.stamp.secs, header.stamp.nsecs, header.stamp.to_nsec()) == (1, 2, 1_000_000_002)
    header.stamp.secs = 3
    header.seq = 7
    assert (header.stamp.sec, header.seq) == (3, 7)
    assert messages.from_cdr("std_msgs/Header", messages.to_cdr(header)).stamp.sec == 3


def test_packages_are_importable_modules() -> None:
    modules = messages.modules()
    assert modules["std_msgs.msg"].String("x").data == "x"
    assert modules["std_msgs"].msg is modules["std_msgs.msg"]
    assert modules["std_srvs.srv"].TriggerResponse(success=True).success
    assert {"Trigger", "TriggerRequest", "TriggerResponse"} <= set(modules["std_srvs.srv"].__all__)
    assert modules["mavros_msgs.srv"].SetMode.Request(custom_mode="GUIDED").custom_mode == "GUIDED"
    assert modules["mavros_msgs.msg"].VFR_HUD is messages.message_class("mavros_msgs/VfrHud")
    with pytest.raises(AttributeError, match=r"std_msgs\.msg has no 'Strng'.*did you mean 'String'"):
        _ = modules["std_msgs.msg"].Strng


def test_definitions_lie_in_folders_below_the_packages_own(tmp_path: Path) -> None:
    folder = tmp_path / "sorted_msgs/msg/control"
    folder.mkdir(parents=True)
    (folder / "Gain.msg").write_text("float64 p\n", encoding="utf-8")
    program = tmp_path / "node.py"
    program.write_text("from sorted_msgs.msg import Gain\n", encoding="utf-8")
    assert messages.define_imported(program) == ["sorted_msgs"]
    assert messages.new("sorted_msgs/Gain", p=2.0).p == 2.0


def test_a_definition_of_the_workspace_wins_over_a_known_one_until_it_is_used(tmp_path: Path) -> None:
    messages.define("won_msgs/msg/Plate", "float64[4] coef\nHeader header\n")
    folder = tmp_path / "won_msgs/msg"
    folder.mkdir(parents=True)
    program = tmp_path / "node.py"
    program.write_text("from won_msgs.msg import Plate\n", encoding="utf-8")

    def defined(text: str) -> list[str]:
        (folder / "Plate.msg").write_text(text, encoding="utf-8")
        return messages.define_imported(program)

    assert defined("# the same\nfloat64[4] coef  # normal\n\nstd_msgs/Header header\n") == []
    assert defined("uint8 FLAT = 1\nfloat64[4] coef\nHeader header\nstring label\n") == ["won_msgs"]
    assert messages.new("won_msgs/Plate", label="a").FLAT == 1
    assert "string label" in messages.definition("won_msgs/Plate")
