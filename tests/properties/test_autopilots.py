"""What must hold of a simulated autopilot's arithmetic for all numbers."""

from __future__ import annotations

from math import isfinite

from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.link import Link
from volery.links.mavlink_messages import message_type
from volery.simulation.autopilots.ardupilot import FIRMWARE
from volery.simulation.autopilots.autopilot import Autopilot
from volery.simulation.autopilots.autopilot_parameters import INT8, INT16, INT32, REAL32, quantised
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.autopilots.manoeuvres.to_point import root_speed, stopping_distance, stopping_point
from volery.simulation.autopilots.manual_control import ChannelRange
from volery.simulation.world.body_specs import Multirotor

speeds = st.floats(0.0, 50.0)
accels = st.floats(0.1, 10.0)
pulses = st.integers(0, 65_535)
travels = st.builds(
    ChannelRange,
    st.integers(800, 2200),
    st.integers(800, 2200),
    st.integers(800, 2200),
    st.integers(0, 200),
    st.booleans(),
)


@given(speeds, accels, st.floats(0.2, 5.0))
def test_the_speed_that_stops_within_the_stopping_distance_is_the_speed(
    speed: float, accel: float, gain: float
) -> None:
    back = root_speed(stopping_distance(speed, accel, gain), accel, gain)
    assert abs(back - speed) <= 1e-6 * max(1.0, speed)


@given(st.floats(0.0, 1000.0), st.floats(0.0, 1000.0), accels)
def test_farther_away_is_never_slower(near: float, more: float, accel: float) -> None:
    assert root_speed(near, accel) <= root_speed(near + more, accel) + 1e-9


@given(st.tuples(*[st.floats(-30.0, 30.0)] * 3), accels, accels)
def test_a_stop_lies_ahead(velocity: tuple[float, float, float], accel: float, accel_z: float) -> None:
    for moved, speed in zip(stopping_point((0.0, 0.0, 0.0), velocity, accel, accel_z), velocity, strict=True):
        assert moved * speed >= 0.0


@given(travels, pulses)
def test_deflections_stay_within_their_ends(travel: ChannelRange, pulse: int) -> None:
    assert -1.0 <= travel.deflection(pulse) <= 1.0
    assert 0.0 <= travel.share(pulse) <= 1.0


@given(st.sampled_from([INT8, INT16, INT32, REAL32]), st.floats(-3e38, 3e38))
def test_a_value_that_was_kept_is_kept_again(kind: int, value: float) -> None:
    kept = quantised(kind, value)
    assert isfinite(kept)
    assert quantised(kind, kept) == kept


# --- whatever a station sends ------------------------------------------------------------------------------

STATION, STATION_COMPONENT = 255, 190
STREAM_ALL = {"target_system": 1, "req_message_rate": 10, "start_stop": 1}


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """A message that the autopilot listens to, of any bytes; commands and parameters mostly such as it
    knows.
    """
    kind = message_type(draw(st.sampled_from(LISTENED)))
    fields = kind.unpack(draw(st.binary(min_size=kind.size, max_size=kind.size)))
    if "target_system" in fields:
        fields["target_system"] = 1
    if "command" in fields:
        fields["command"] = draw(st.sampled_from(COMMANDS) | st.just(fields["command"]))
    if "param_id" in fields:
        fields["param_id"] = draw(st.sampled_from(PARAMETERS))
    return Frame(kind.name, fields, STATION, STATION_COMPONENT)


def _vehicle() -> tuple[VirtualKernel, Autopilot, Link]:
    kernel = VirtualKernel()
    place = LocalFrame(48.0, 11.0, 500.0)
    _, (flight,) = make_world(kernel.now, [Multirotor(sensors="perfect")], seed=1, frame=place)
    autopilot = FIRMWARE.create(kernel, flight, warm=True)
    ours, theirs = in_process_pair(kernel, MS, "station")
    autopilot.connect(theirs)
    return kernel, autopilot, ours


COMMANDS = [*sorted(_vehicle()[1].endpoint.firmware.commands.commands), 510, 511, 512, 520]
PARAMETERS = sorted(FIRMWARE.kinds["multirotor"].rules.parameters.supported)
LISTENED = sorted(_vehicle()[1].endpoint.handled_messages)


@settings(max_examples=40, deadline=None)
@given(st.lists(frames(), max_size=20), st.booleans())
def test_no_message_upsets_an_autopilot(sent: list[Frame], flying: bool) -> None:
    kernel, autopilot, link = _vehicle()
    received: list[Frame] = []
    link.receive(received.append)
    kernel.run(S)
    link.send(Frame("REQUEST_DATA_STREAM", STREAM_ALL, STATION, STATION_COMPONENT))
    if flying:
        for fields in ({"command": 176, "param1": 1, "param2": 4}, {"command": 400, "param1": 1}):
            link.send(Frame("COMMAND_LONG", {"target_system": 1, **fields}, STATION, STATION_COMPONENT))
        climb = {"target_system": 1, "command": 22, "param7": 3.0}
        link.send(Frame("COMMAND_LONG", climb, STATION, STATION_COMPONENT))
        kernel.run(8 * S)
    for frame in sent:
        link.send(frame)
        kernel.run(kernel.now() + 50 * MS)
    received.clear()
    kernel.run(kernel.now() + 4 * S)
    assert any(frame.name == "HEARTBEAT" for frame in received)
    state = autopilot.state()
    assert isfinite(state.x + state.y + state.z)
