"""A ground station's connection, request by request: each has an answer, and nothing waits for ever."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest

from rigs.station import TARGET, Station
from volery.base.frames import LocalFrame
from volery.base.time import MS, US
from volery.links.frame import Frame
from volery.links.mavlink_messages import message_type
from volery.simulation.autopilots import ardupilot, px4
from volery.simulation.autopilots.mavlink.channel import MOST_WAITING_ON_LINK
from volery.trace.events import LinkState, ignore

COMMANDS = (
    *(16, 17, 18, 19, 20, 21, 22, 34, 84, 85, 92, 94, 112, 115, 176, 177, 178, 179, 181, 182, 183, 184, 185),
    *(189, 191, 192, 193, 194, 195, 197, 201, 202, 203, 205, 206, 207, 208, 209, 211, 212, 213, 218, 222),
    *(224, 241, 242, 243, 245, 300, 310, 401, 410, 420, 500, 510, 511, 512, 519, 520, 521, 522, 525, 527),
    *(530, 531, 532, 534, 1000, 1001, 2000, 2001, 2500, 2501, 2510, 2520, 2600, 2601, 2800, 3000, 4000),
    *(5200, 10001, 30001, 31000, 31010, 42000, 42007, 42424, 42425, 42426, 42428, 42600, 42650, 42651),
)
"""MAV_CMD of ground stations, each with parameters of zero; 400 and 246 would arm and reboot."""

REQUESTED = (0, 1, 2, 22, 24, 30, 32, 33, 36, 42, 49, 74, 77, 105, 125, 141, 147, 148, 230, 242, 245, 253)
REQUESTED_LATER = (259, 263, 280, 283, 300, 309, 340, 365, 395, 397, 401, 410, 411, 435, 436, 12915, 65_000)
"""Messages of REQUEST_MESSAGE, those that no vehicle has included."""

MESSAGES: tuple[tuple[str, dict[str, Any], str], ...] = (
    ("PARAM_REQUEST_READ", {"param_id": "{parameter}", "param_index": -1}, "PARAM_VALUE"),
    ("PARAM_REQUEST_LIST", {}, "PARAM_VALUE"),
    ("MISSION_REQUEST_LIST", {"mission_type": 0}, "MISSION_COUNT"),
    ("MISSION_REQUEST_LIST", {"mission_type": 1}, "MISSION_COUNT"),
    ("MISSION_REQUEST_LIST", {"mission_type": 2}, "MISSION_COUNT"),
    ("MISSION_REQUEST_LIST", {"mission_type": 7}, "MISSION_ACK"),
    ("MISSION_REQUEST_INT", {"seq": 99, "mission_type": 0}, "MISSION_ACK"),
    ("MISSION_REQUEST", {"seq": 99, "mission_type": 1}, "MISSION_ACK"),
    ("MISSION_COUNT", {"count": 0, "mission_type": 0}, "MISSION_ACK"),
    ("MISSION_COUNT", {"count": 0, "mission_type": 1}, "MISSION_ACK"),
    ("MISSION_COUNT", {"count": 0, "mission_type": 2}, "MISSION_ACK"),
    ("MISSION_COUNT", {"count": 2, "mission_type": 7}, "MISSION_ACK"),
    ("MISSION_COUNT", {"count": 9999, "mission_type": 0}, "MISSION_ACK"),
    ("MISSION_CLEAR_ALL", {"mission_type": 0}, "MISSION_ACK"),
    ("MISSION_CLEAR_ALL", {"mission_type": 1}, "MISSION_ACK"),
    ("MISSION_CLEAR_ALL", {"mission_type": 2}, "MISSION_ACK"),
    ("MISSION_CLEAR_ALL", {"mission_type": 255}, "MISSION_ACK"),
    ("MISSION_ITEM_INT", {"seq": 0, "command": 16, "frame": 3, "mission_type": 0}, "MISSION_ACK"),
    ("LOG_REQUEST_LIST", {"start": 0, "end": 65_535}, "LOG_ENTRY"),
    (
        "FILE_TRANSFER_PROTOCOL",
        {"payload": [1, 0, 0, 3, 1, *[0] * 7, 47]},
        "FILE_TRANSFER_PROTOCOL",
    ),
    ("PING", {"seq": 5, "target_system": 0, "target_component": 0}, "PING"),
)


class Bench(Station):
    """A vehicle of either firmware and a ground station."""

    home = LocalFrame(47.3977, 8.5456, 488.0)

    def __init__(self, firmware: Any, kind: str = "copter", record: Any = ignore) -> None:
        self.firmware, self.record = firmware, record
        super().__init__(kind)
        self.beat()
        self.run(1.0)

    def answer(self, message: str, fields: dict[str, Any], within: float = 2.0) -> list[str]:
        """Names of what arrives after a message until its answer is due."""
        before = len(self.received)
        self.send(message, **{**TARGET, **fields})
        self.run(within)
        return [one.name for one in self.received[before:]]


@pytest.fixture(params=["ardupilot", "px4"])
def rig(request: Any) -> Bench:
    return Bench({"ardupilot": ardupilot.FIRMWARE, "px4": px4.FIRMWARE}[request.param])


UNANSWERED = {"ardupilot": [], "px4": [420, 42600]}
"""Commands for modules that do not run: the original does not answer them either."""


def test_every_command_is_acknowledged_in_both_forms(rig: Bench) -> None:
    unanswered = UNANSWERED[rig.firmware.name]
    long = [number for number in COMMANDS if rig.command(number) is None]
    whole = [number for number in COMMANDS if rig.command_int(number, frame=3, x=0, y=0, z=0.0) is None]
    assert (long, whole) == (unanswered, unanswered)


def test_every_requested_message_is_sent_or_refused(rig: Bench) -> None:
    silent = []
    for number in (*REQUESTED, *REQUESTED_LATER):
        if rig.command(512, number) is None or rig.command(510, number) is None:
            silent.append(number)
    assert silent == []


def test_every_message_that_wants_an_answer_has_one(rig: Bench) -> None:
    name = "MAV_SYSID" if rig.firmware is ardupilot.FIRMWARE else "MAV_SYS_ID"
    silent = []
    for message, fields, answer in MESSAGES:
        asked = {key: name if value == "{parameter}" else value for key, value in fields.items()}
        if answer not in rig.answer(message, asked, 0.3):
            silent.append((message, fields))
    assert silent == []


ROUND_US, ROUND_MS = 2**32 * US, 2**32 * MS


@pytest.mark.parametrize(
    ("firmware", "kind"),
    [
        (family, kind)
        for family in (ardupilot.FIRMWARE, px4.FIRMWARE)
        for kind in ("copter", "rover")
        if {"copter": "multirotor"}.get(kind, kind) in family.kinds
    ],
)
def test_clocks_of_32_bits_begin_anew(firmware: Any, kind: str) -> None:
    """All streams go on beyond 71 min 35 s and beyond 49.7 days."""
    events: list[Any] = []
    rig = Bench(firmware, kind, events.append)
    for name in rig.autopilot.endpoint.firmware.telemetry.messages:  # type: ignore[attr-defined]
        rig.send("COMMAND_LONG", **TARGET, command=511, param1=message_type(name).id, param2=200_000.0)
    rig.run(1.0)
    usual = {one.name for one in rig.received}
    for period, field in ((ROUND_US, "time_usec"), (ROUND_MS, "time_boot_ms")):
        rig.vehicle.boot_at = rig.kernel.now() - period + 300 * MS
        rig.run(0.01)
        rig.received.clear()
        rig.run(1.2)
        message = "SERVO_OUTPUT_RAW" if field == "time_usec" else "ATTITUDE"
        times = [one.fields[field] for one in rig.of(message)]
        assert max(times) > 2**31 > min(times)
        assert {"SERVO_OUTPUT_RAW", "ATTITUDE"} <= {one.name for one in rig.received}
    assert "SERVO_OUTPUT_RAW" in usual
    assert [one for one in events if isinstance(one, LinkState)] == []


def test_what_a_field_does_not_hold_is_left_out_and_the_rest_goes_on(rig: Bench) -> None:
    dropped: list[LinkState] = []
    rig.kernel.record = dropped.append
    rig.command(511, 33, 100_000.0)
    rig.vehicle.set_home(47.0, 8.0, 1e9)
    rig.run(3.0)
    assert [one.state for one in dropped if isinstance(one, LinkState)] == ["dropped", "dropped"]
    rig.received.clear()
    rig.run(2.0)
    assert "HEARTBEAT" in {one.name for one in rig.received}
    assert "GLOBAL_POSITION_INT" not in {one.name for one in rig.received}


@pytest.mark.parametrize("altitude", [-3e6, 3e6, 1e38, nan, inf])
def test_a_home_position_beyond_all_limits_is_denied(rig: Bench, altitude: float) -> None:
    before = rig.vehicle.home
    assert rig.command(179, 0, 0, 0, 0, 47.0, 8.0, altitude) == 2
    assert rig.command_int(179, frame=0, x=470_000_000, y=80_000_000, z=altitude) == 2
    assert rig.vehicle.home == before


def test_a_flood_of_frames_is_bounded_and_another_client_goes_on(rig: Bench) -> None:
    dropped: list[LinkState] = []
    rig.kernel.record = dropped.append
    flooding = rig.another_link()
    for _ in range(10_000):
        flooding.send(Frame("HEARTBEAT", {"type": 6, "autopilot": 8}, 77, 1))
    rig.send("PING", seq=5, target_system=0, target_component=0)
    for system in range(1, 250):
        for _ in range(40):
            flooding.send(Frame("HEARTBEAT", {"type": 6, "autopilot": 8}, system, 1))
    handled = 0

    def count(*_: Any) -> None:
        nonlocal handled
        handled += 1

    rig.autopilot.endpoint.channels[1].take = count  # type: ignore[attr-defined]
    rig.run(1.0)
    assert handled == MOST_WAITING_ON_LINK
    assert "PING" in {one.name for one in rig.received}
    assert {one.state for one in dropped if isinstance(one, LinkState)} == {"dropped"}
