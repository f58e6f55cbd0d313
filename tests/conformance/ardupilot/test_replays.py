"""Every recorded session with the real firmware, sent again to the simulated one: the same answers, words,
states.

What a station sends is taken from the recording, at the recorded times after boot. Words and states must
come in the same number; on the ground at the recorded times, in the air within a fifth of the time since
take-off.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from itertools import groupby
from typing import Any

import pytest

from rigs.station import GOLDEN
from volery.base.frames import LocalFrame
from volery.simulation.autopilots.ardupilot import FIRMWARE

COPTER = ("arm-refused", "takeoff-refused", "guided-flight", "gcs-failsafe", "params-mission")
READY_TO_FLY = 42.5
ON_GROUND = 0.6
IN_AIR = 0.2
STICK_PERIOD = 0.04
ARMED, STANDBY = 128, 3


def replayed(bench: Any, script: dict[str, Any]) -> Any:
    kind = "rover" if "Throttle armed" in [text for _, _, text in script["texts"]] else "copter"
    rig = bench(kind, warm=False)
    for at, name, fields in script["sent"]:
        rig.at(at, lambda name=name, fields=fields: rig.send(name, **fields))
    end = max(at for at, *_ in [*script["sent"], *script["texts"], *script["states"]]) + 8.0
    beats = script["beats"]
    for at in [*beats, *(beats[-1] + later for later in range(1, int(end - beats[-1]) + 1))]:
        rig.at(at, lambda: rig.send("HEARTBEAT", type=6, autopilot=8))
    for start, last, pulses in script["sticks"]:
        for step in range(int((last - start) / STICK_PERIOD) + 1):
            rig.at(start + step * STICK_PERIOD, lambda pulses=pulses: rig.sticks(*pulses))
    rig.run(end)
    return rig


def general(text: str) -> str:
    """Words without the figures of one flight and one board."""
    return re.sub(r"^[0-9a-f]{32}$", "board", re.sub(r"at [\d.]+ m/s", "at some m/s", text))


def by_words(texts: list[tuple[float, str]]) -> dict[str, list[float]]:
    found: dict[str, list[float]] = defaultdict(list)
    for at, text in texts:
        found[general(text)].append(at)
    return found


def near(recorded: float, simulated: float) -> bool:
    return abs(recorded - simulated) <= max(ON_GROUND, IN_AIR * (recorded - READY_TO_FLY))


@pytest.fixture(params=[*COPTER, "rover-drive"])
def session(request: Any, facts: dict[str, Any], bench: Any) -> tuple[dict[str, Any], Any]:
    script = facts["replays"][request.param]
    return script, replayed(bench, script)


def test_a_recorded_session_gets_the_recorded_answers_words_and_states(
    session: tuple[dict[str, Any], Any],
) -> None:
    script, rig = session
    acks = [(one.fields["command"], one.fields["result"]) for one in rig.of("COMMAND_ACK")]
    assert acks == [(command, result) for _, command, result in script["acks"]]
    check_words(script, rig)
    check_states(script, rig)
    reached = [one.fields["seq"] for one in rig.of("MISSION_ITEM_REACHED")]
    assert reached == [sequence for _, sequence in script["reached"]]


def check_words(script: dict[str, Any], rig: Any) -> None:
    recorded = by_words([(at, text) for at, _, text in script["texts"]])
    end = max(at for at, *_ in [*script["sent"], *script["texts"], *script["states"]]) + 1.0
    simulated = by_words([(one.at, one.fields["text"]) for one in rig.of("STATUSTEXT") if one.at <= end])
    assert {text: len(times) for text, times in simulated.items()} == {
        text: len(times) for text, times in recorded.items()
    }
    for text, times in recorded.items():
        for was, is_now in zip(times, simulated[text], strict=True):
            assert near(was, is_now), f"{text!r} at {is_now:.2f} s, recorded at {was:.2f} s"


def lasting(states: list[tuple[float, list[int]]]) -> list[tuple[float, list[int]]]:
    """Without those that a heartbeat a second shows by chance: standing for a moment before it disarms."""
    following = [*states[1:], (0.0, [0, 0, 0])]
    return [
        (at, state)
        for (at, state), (later, then) in zip(states, following, strict=True)
        if not (state[0] - then[0] == ARMED and state[1:] == [then[1], STANDBY] and later - at < 1.1)
    ]


def check_states(script: dict[str, Any], rig: Any) -> None:
    states: list[tuple[float, list[int]]] = []
    for one in rig.of("HEARTBEAT"):
        state = [one.fields["base_mode"], one.fields["custom_mode"], one.fields["system_status"]]
        if not states or states[-1][1] != state:
            states.append((one.at, state))
    recorded = lasting([(at, state) for at, *state in script["states"]])
    states = lasting(states)
    assert [state for _, state in states] == [state for _, state in recorded]
    for (is_now, state), (was, _) in zip(states, recorded, strict=True):
        assert near(was, is_now + 0.5) or near(was, is_now - 0.5), (
            f"{state} at {is_now:.2f} s, recorded at {was:.2f} s"
        )


def test_4_8_answers_as_recorded(bench: Any) -> None:
    """Guided flight, attitudes with and without body rates, a plan with a camera's item, names of parameters.

    AVAILABLE_MODES is not simulated: its request fails.
    """

    class Newest(bench):  # type: ignore[misc]
        firmware = FIRMWARE
        home = LocalFrame(46.0825, -103.8995, 900.0)
        heading = 0.0

    script = json.loads((GOLDEN / "ardupilot" / "replays-4.8.json").read_text(encoding="utf-8"))["guided"]
    rig = replayed(Newest, script)
    acks = [[one.fields["command"], one.fields["result"]] for one in rig.of("COMMAND_ACK")]
    recorded = [[command, result] for _, command, result in script["acks"]]
    assert acks[1] == [512, 4]
    assert [acks[0], *acks[2:]] == [recorded[0], *recorded[2:]]
    reached = [one.fields["seq"] for one in rig.of("MISSION_ITEM_REACHED")]
    assert reached == [sequence for _, sequence in script["reached"]]
    modes = [mode for mode, _ in groupby(one.fields["custom_mode"] for one in rig.of("HEARTBEAT"))]
    assert modes == [mode for mode, _ in groupby(state[2] for state in script["states"])]
    assert not rig.vehicle.armed
    missing = [one.fields["param_id"] for one in rig.of("PARAM_ERROR")]
    assert len(missing) == 10
    assert {"WPNAV_SPEED", "RTL_ALT", "ARMING_CHECK"} <= set(missing)
    assert rig.of("ATTITUDE_TARGET")
