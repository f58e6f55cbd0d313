"""Whole recordings sent again: what the station sent then, at the times when it did, and what came back."""

from __future__ import annotations

import re
from itertools import groupby
from math import nan
from typing import Any

import pytest

from volery.base.time import S, from_seconds
from volery.simulation.autopilots.px4.firmware import FIRST_HEARTBEAT

USES = {
    "ground-api": "onboard",
    "basic-api": "onboard",
    "offboard-api": "onboard",
    "auto-gcs": "station",
    "manual-gcs": "station",
}

OURS: dict[str, Any] = {}
"""Each recording is flown once."""


def flown(name: str, facts: dict[str, Any], bench: Any) -> Any:
    """The simulated autopilot after it received what the real one received."""
    if name not in OURS:
        OURS[name] = _fly(name, facts["replays"][name], bench)
    return OURS[name]


def _fly(name: str, recorded: dict[str, Any], bench: Any) -> Any:
    targets = {fields.get("target_system", 0) for _, _, fields in recorded["sent"]} - {0}
    rig = bench(warm=False, use=USES[name], beats=False, system=max(targets))

    shift = (1.0 + FIRST_HEARTBEAT / S - recorded["states"][0][0] % 1.0) % 1.0
    shift -= round(shift)  # commands fall between heartbeats as they did then,
    shift += 0.006  # the firmware's parts tell each other that much later

    def at(seconds: float, action: Any) -> None:
        rig.kernel.call_at(from_seconds(seconds + shift), action)

    def sender(message: str, fields: dict[str, Any]) -> Any:
        whole = {key: nan if value == "nan" else value for key, value in fields.items()}
        return lambda: rig.send(message, **whole)

    for seconds, message, fields in recorded["sent"]:
        at(seconds, sender(message, fields))
    for message, segments in recorded["held"].items():
        for start, end, count, fields in segments:
            for place in range(count):
                at(start + (end - start) * place / max(1, count - 1), sender(message, fields))
    first, last = (beat + shift for beat in recorded["beats"])
    for beat in range(round(last - first) + 1):
        at(first - shift + beat, lambda: rig.send("HEARTBEAT", type=6, autopilot=8))
    rig.kernel.run(from_seconds(last) + 2 * S)
    return rig


@pytest.mark.parametrize("name", USES)
def test_every_command_gets_the_recorded_answer(name: str, facts: dict[str, Any], bench: Any) -> None:
    rig = flown(name, facts, bench)
    ours = [[one.fields["command"], one.fields["result"]] for one in rig.of("COMMAND_ACK")]
    assert ours == [[command, result] for _, command, result in facts["replays"][name]["acks"]]


def wording(texts: list[str]) -> list[str]:
    """Without figures, and what is said again and again once."""
    bare = (re.sub(r"\d+(\.\d+)?", "#", text) for text in texts)
    return [text for text, _ in groupby(bare)]


WHERE_IT_WAS = ("RTL: ",)
"""Words that depend on where exactly the aircraft was when it returned, in the recording flown by hand."""


@pytest.mark.parametrize("name", USES)
def test_the_recorded_words_are_said_in_order(name: str, facts: dict[str, Any], bench: Any) -> None:
    rig = flown(name, facts, bench)
    ours, theirs = rig.texts(), [text for _, _, text in facts["replays"][name]["texts"]]
    if name == "manual-gcs":
        ours, theirs = (
            [text for text in texts if not text.startswith(WHERE_IT_WAS)] for texts in (ours, theirs)
        )
    assert wording(ours) == wording(theirs)


@pytest.mark.parametrize("name", USES)
def test_the_heartbeat_shows_the_recorded_states(name: str, facts: dict[str, Any], bench: Any) -> None:
    rig = flown(name, facts, bench)
    ours = [
        [one.fields["base_mode"], one.fields["custom_mode"], one.fields["system_status"]]
        for one in rig.of("HEARTBEAT")
    ]
    recorded = [state[1:] for state in facts["replays"][name]["states"]]
    assert [state for state, _ in groupby(ours)] == recorded


@pytest.mark.parametrize("name", [name for name in USES if name != "manual-gcs"])
def test_the_recorded_landed_states_are_passed(name: str, facts: dict[str, Any], bench: Any) -> None:
    rig = flown(name, facts, bench)
    ours = [state for state, _ in groupby(one.fields["landed_state"] for one in rig.of("EXTENDED_SYS_STATE"))]
    assert ours == [state for _, state in facts["replays"][name]["landed"]]


@pytest.mark.parametrize("name", USES)
def test_the_recorded_kinds_of_events_are_sent(name: str, facts: dict[str, Any], bench: Any) -> None:
    """Nothing that was recorded is missing, and nothing is told that was never recorded."""
    known = {event[1] for rows in facts["boot"].values() for event in rows["events"]}
    known |= {event[0] for rows in facts["events"].values() for event in rows}
    ours, theirs = set(flown(name, facts, bench).events()), {event[0] for event in facts["events"][name]}
    assert ours <= known
    assert theirs - ours <= {LOGGER, *OF_THE_RETURN}


def test_a_mission_is_requested_and_reported_as_recorded(facts: dict[str, Any], bench: Any) -> None:
    rig, recorded = flown("auto-gcs", facts, bench), facts["replays"]["auto-gcs"]
    ours = [
        [one.name, one.fields["seq"]]
        for one in rig.received
        if one.name in ("MISSION_REQUEST", "MISSION_REQUEST_INT")
    ]
    assert ours == recorded["requests"]
    reached = groupby(one.fields["seq"] for one in rig.of("MISSION_ITEM_REACHED"))
    assert [[seq, len(list(group))] for seq, group in reached] == recorded["reached"]


LOGGER = 0x01125BEF
OF_THE_RETURN = (0x01F62F50, 0x01B911E0, 0x0102D3AA)
"""Stages that the simulated aircraft may not come to in the recorded time."""
