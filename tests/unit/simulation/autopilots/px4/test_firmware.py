"""The parts of the simulated PX4, each alone; and that the same seed gives the same flight."""

from __future__ import annotations

from math import isnan, nan
from statistics import fmean
from typing import Any

import pytest

from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.mavlink_messages import from_bytewise, status_text_chunks, to_bytewise
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.autopilots.mavlink.channel import StatusTextPolicy, StatusTextQueue
from volery.simulation.autopilots.px4 import FIRMWARE
from volery.simulation.autopilots.px4.event_interface import ArmingChecks, arming_report
from volery.simulation.autopilots.px4.flight_modes import apply_expo, interpolated
from volery.simulation.autopilots.px4.modes import custom_mode, main_and_sub
from volery.simulation.autopilots.px4.offboard import (
    ManualControlState,
    OffboardSetpoints,
    OffboardTarget,
    StickDeflection,
    attitude_target,
    deflection,
)
from volery.simulation.world.body_specs import Multirotor, WheeledRover


def test_a_mode_is_two_numbers_in_one() -> None:
    assert custom_mode(4, 3) == 0x03040000
    assert main_and_sub(0x03040000) == (4, 3)


@pytest.mark.parametrize(
    ("axes", "found"),
    [
        ({"x": 0, "y": 0, "z": 500, "r": 0}, StickDeflection(0.0, 0.0, 0.0, 0.0)),
        ({"x": 1000, "y": -500, "z": 1000, "r": 250}, StickDeflection(1.0, -0.5, 1.0, 0.25)),
        ({"x": 2000, "y": 0, "z": -900, "r": 0}, StickDeflection(1.0, 0.0, -1.0, 0.0)),
        ({"x": 32767, "y": 0, "z": 500, "r": 0}, None),
    ],
)
def test_sticks_are_centred_at_500_and_stay_within_their_way(
    axes: dict[str, int], found: StickDeflection | None
) -> None:
    assert deflection(axes) == found


def test_sticks_that_come_back_have_not_moved() -> None:
    sticks = ManualControlState()
    assert sticks.receive(StickDeflection(pitch=0.9), S) == 0.0
    assert not sticks.moved(0.3)
    sticks.valid = False
    assert sticks.receive(StickDeflection(pitch=-0.9), 3 * S) == 2.0
    assert not sticks.moved(0.3)
    sticks.receive(StickDeflection(pitch=0.0), 3 * S + 1)
    assert sticks.moved(0.3)


def test_a_stream_lives_as_long_as_it_may() -> None:
    stream = OffboardSetpoints()
    assert not stream.alive(0, S)
    stream.receive(OffboardTarget(position=(0.0, 0.0, -5.0)), S)
    assert stream.alive(2 * S, S)
    assert not stream.alive(2 * S + 1, S)


def test_a_setpoint_lifts_only_if_it_is_above() -> None:
    assert OffboardTarget(position=(nan, nan, -2.0)).lifts(0.0)
    assert not OffboardTarget(position=(5.0, 5.0, 0.5)).lifts(0.0)
    assert OffboardTarget(velocity=(0.0, 0.0, -0.5)).lifts(0.0)
    assert not OffboardTarget(velocity=(1.0, 0.0, nan)).lifts(0.0)


def test_an_attitude_without_a_thrust_is_no_setpoint() -> None:
    fields: dict[str, Any] = {"type_mask": 0, "q": (2.0, 0.0, 0.0, 0.0), "thrust": 1.5, "body_yaw_rate": 0.1}
    found = attitude_target(fields)
    assert found is not None
    assert (found.attitude, found.thrust, found.yaw_rate) == ((1.0, 0.0, 0.0, 0.0), 1.0, 0.1)
    assert attitude_target({**fields, "type_mask": 1 << 6}) is None
    assert attitude_target({**fields, "q": (nan, 0.0, 0.0, 0.0)}) is None


@pytest.mark.parametrize("number", [0, 4, -1, 2_147_483_647, -737_578_370])
def test_an_integer_survives_as_bytes(number: int) -> None:
    assert from_bytewise(6, to_bytewise(6, float(number))) == number


def test_all_checks_passed_leaves_two_summaries() -> None:
    fine = ArmingChecks(*([True] * 9))
    assert len(arming_report(fine)) == 2
    assert len(arming_report(fine._replace(position=False))) == 4


def test_curves() -> None:
    assert apply_expo(0.1, 0.1) == 0.0
    assert apply_expo(1.0, 0.1) == 1.0
    assert apply_expo(-1.0, 0.1) == -1.0
    assert 0.0 < apply_expo(0.3, 0.1) < 0.2
    assert interpolated(7.5, (5.0, 0.7), (10.0, 1.5)) == pytest.approx(1.1)
    assert interpolated(20.0, (5.0, 0.7), (10.0, 1.5)) == 1.5


def test_texts_wait_for_a_station_keep_their_distance_and_the_newest_four() -> None:
    kernel, sent = VirtualKernel(), []
    line = StatusTextQueue(
        kernel,
        StatusTextPolicy(to_stations=True, spacing=50 * MS),
        lambda fields: sent.append((kernel.now(), fields)),
    )
    for number in range(6):
        line.put(status_text_chunks(6, f"text {number}", number))
    kernel.run(S)
    assert sent == []
    line.on_heartbeat(18)
    kernel.run(2 * S)
    assert sent == []
    line.on_heartbeat(6)
    kernel.run(3 * S)
    assert [fields["text"] for _, fields in sent] == [f"text {number}" for number in range(2, 6)]
    assert [at - sent[0][0] for at, _ in sent] == [0, 50 * MS, 100 * MS, 150 * MS]


def flown(kind: str, seed: int, wanted: frozenset[str] | None = None) -> list[tuple[Any, ...]]:
    """All messages that one link receives during a short flight or drive; it may state which it uses."""
    kernel = VirtualKernel()
    spec = Multirotor() if kind == "multirotor" else WheeledRover()
    _, flights = make_world(kernel.now, [spec], seed=seed, frame=LocalFrame(46.0, 7.0, 500.0))
    autopilot = FIRMWARE.create(kernel, flights[0], warm=True)
    ours, theirs = in_process_pair(kernel, MS, "station")
    received: list[tuple[Any, ...]] = []
    ours.receive(lambda frame: received.append((kernel.now(), frame.name, repr(frame.fields))))
    if wanted is not None:
        ours.select(wanted.__contains__)
    autopilot.connect(theirs)

    def setpoint() -> None:
        fields = {"target_system": 1, "coordinate_frame": 1, "type_mask": 3576, "x": 5.0, "z": -4.0}
        ours.send(Frame("SET_POSITION_TARGET_LOCAL_NED", fields, 255, 190))

    def command(number: int, *params: float) -> None:
        values = {f"param{place}": value for place, value in enumerate(params, start=1)}
        fields = {"target_system": 1, "target_component": 1, "command": number, **values}
        ours.send(Frame("COMMAND_LONG", fields, 255, 190))

    kernel.every(50 * MS, setpoint)
    kernel.call_at(S, lambda: command(176, 1, 6))
    kernel.call_at(2 * S, lambda: command(400, 1))
    kernel.run(8 * S)
    assert autopilot.vehicle.armed
    return received


@pytest.mark.parametrize("kind", ["multirotor", "rover"])
def test_the_same_seed_is_the_same_flight(kind: str) -> None:
    assert flown(kind, 5) == flown(kind, 5)
    assert flown(kind, 5) != flown(kind, 6)


def test_nan_is_not_asked() -> None:
    assert all(isnan(value) for value in OffboardTarget().position)


def test_telemetry_that_the_other_end_does_not_use_is_not_sent() -> None:
    everything = flown("multirotor", 5)
    used = frozenset({"GLOBAL_POSITION_INT", "COMMAND_ACK"})
    received = flown("multirotor", 5, used)
    kept = [one for one in received if one[1] in used]
    assert kept == [one for one in everything if one[1] in used]
    assert {name for _, name, _ in kept} == used
    others = {"HIGHRES_IMU", "ATTITUDE_QUATERNION", "VFR_HUD", "ODOMETRY"}
    assert others <= {name for _, name, _ in everything}
    assert not others & {name for _, name, _ in received}


def test_a_stated_position_is_cut_off_and_not_rounded() -> None:
    """PX4 converts degrees to integers as C++ does: in the mean half a count nearer to zero."""
    kernel = VirtualKernel()
    frame = LocalFrame(46.0, -7.0, 500.0)
    _, flights = make_world(kernel.now, [Multirotor()], seed=3, frame=frame)
    autopilot = FIRMWARE.create(kernel, flights[0], warm=True)
    ours, theirs = in_process_pair(kernel, MS, "station")
    cuts: list[tuple[float, float]] = []

    def compare(found: Frame) -> None:
        if found.name == "GLOBAL_POSITION_INT":
            latitude, longitude, _ = autopilot.vehicle.estimate.geodetic
            cuts.append((latitude * 1e7 - found.fields["lat"], longitude * 1e7 - found.fields["lon"]))

    ours.receive(compare)
    autopilot.connect(theirs)
    kernel.run(30 * S)
    assert len(cuts) > 100
    assert fmean(north for north, _ in cuts) == pytest.approx(0.5, abs=0.2)
    assert fmean(east for _, east in cuts) == pytest.approx(-0.5, abs=0.2)
