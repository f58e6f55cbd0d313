from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.errors import UsageError
from volery.ros import messages
from volery.ros.messages.message import TimeValue

FLOATS = st.floats(allow_nan=False, width=64)
TEXTS = st.text(st.characters(exclude_characters="\x00", exclude_categories=["Cs"]), max_size=40)


@st.composite
def twists(draw: st.DrawFn) -> Any:
    message = messages.new("geometry_msgs/TwistStamped")
    message.header.frame_id = draw(TEXTS)
    message.header.stamp.sec = draw(st.integers(-(2**31), 2**31 - 1))
    message.header.stamp.nanosec = draw(st.integers(0, 2**32 - 1))
    for vector in (message.twist.linear, message.twist.angular):
        vector.x, vector.y, vector.z = draw(FLOATS), draw(FLOATS), draw(FLOATS)
    return message


@given(twists())
def test_fixed_and_text_fields_survive_their_bytes(message: Any) -> None:
    assert messages.from_cdr(message.__msgtype__, messages.to_cdr(message)) == message


@given(st.lists(st.integers(0, 65535), max_size=30), st.integers(0, 255))
def test_sequences_survive_their_bytes(channels: list[int], rssi: int) -> None:
    message = messages.new("mavros_msgs/RCIn", channels=channels, rssi=rssi)
    back = messages.from_cdr("mavros_msgs/RCIn", messages.to_cdr(message))
    assert back.channels.tolist() == channels
    assert back.rssi == rssi


@given(st.lists(st.tuples(TEXTS, st.lists(FLOATS, max_size=5)), max_size=5))
def test_lists_of_messages_survive_their_bytes(rows: list[tuple[str, list[float]]]) -> None:
    points = [messages.new("trajectory_msgs/JointTrajectoryPoint", positions=row) for _, row in rows]
    message = messages.new(
        "trajectory_msgs/JointTrajectory", joint_names=[name for name, _ in rows], points=points
    )
    back = messages.from_cdr(message.__msgtype__, messages.to_cdr(message))
    assert back == message.copy()


@given(st.binary(max_size=80))
@settings(max_examples=200)
def test_any_bytes_are_a_message_or_a_usage_error(data: bytes) -> None:
    try:
        message = messages.from_cdr("sensor_msgs/NavSatFix", data)
    except UsageError:
        return
    assert isinstance(message.position_covariance, np.ndarray)


@given(st.integers(-(2**62), 2**62), st.integers(-(2**62), 2**62))
def test_time_differences_are_exact(one: int, other: int) -> None:
    messages.message_class("builtin_interfaces/Time")
    assert (TimeValue.of(one) - TimeValue.of(other)).to_nsec() == one - other
