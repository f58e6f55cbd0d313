"""What must hold of the simulated Paparazzi whatever the ground sends."""

from __future__ import annotations

from math import isfinite
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.pprzlink_codec import PPRZLINK
from volery.links.pprzlink_messages import message_type
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.autopilots.paparazzi import FIRMWARE
from volery.simulation.autopilots.paparazzi.endpoint import HANDLERS
from volery.simulation.world.body_specs import Multirotor

AIRCRAFT = 1
FULL_SETTINGS = range(4)


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """A message that it listens to, of any bytes, for this aircraft; numbers mostly such as it knows."""
    kind = message_type(draw(st.sampled_from(sorted(HANDLERS))))
    if kind.name == "RC_UP":
        return Frame(kind.name, {"ac_id": AIRCRAFT, "channels": draw(_CHANNELS)}, 0, 0)
    size = len(kind.pack({}))
    fields: dict[str, Any] = kind.unpack(draw(st.binary(min_size=size, max_size=size))) or {}
    if "ac_id" in fields:
        fields["ac_id"] = AIRCRAFT
    if kind.name == "SETTING":
        fields["index"] = draw(st.sampled_from(FULL_SETTINGS) | st.just(fields["index"]))
        fields["value"] = draw(st.integers(0, 19).map(float) | st.just(fields["value"]))
    if kind.name == "BLOCK":
        fields["block_id"] = draw(st.integers(0, 17) | st.just(fields["block_id"]))
    if kind.name == "GUIDED_SETPOINT_NED" and draw(st.booleans()):
        fields |= {name: draw(st.floats(-100.0, 100.0, width=32)) for name in ("x", "y", "z", "yaw")}
    return Frame(kind.name, fields, 0, 0)


_CHANNELS = st.lists(st.integers(-128, 127), max_size=12).map(tuple)


@settings(max_examples=100, deadline=None)
@given(st.lists(frames(), max_size=25), st.sampled_from(["ground", "nav", "guided"]))
def test_no_message_upsets_it(sent: list[Frame], where: str) -> None:
    kernel = VirtualKernel()
    place = LocalFrame(48.0, 11.0, 500.0)
    _, (flight,) = make_world(kernel.now, [Multirotor(sensors="perfect")], seed=1, frame=place)
    autopilot = FIRMWARE.create(kernel, flight, system=AIRCRAFT, warm=True)
    link, theirs = in_process_pair(kernel, MS, "ground", PPRZLINK)
    autopilot.connect(theirs)
    received: list[Frame] = []
    link.receive(received.append)
    kernel.run(S)

    def send(name: str, **fields: float) -> None:
        link.send(Frame(name, {"ac_id": AIRCRAFT, **fields}, 0, 0))

    if where != "ground":
        send("SETTING", index=4, value=0.0)
        send("BLOCK", block_id=4)
        kernel.run(8 * S)
    if where == "guided":
        send("SETTING", index=5, value=19.0)
    for frame in sent:
        link.send(frame)
        kernel.run(kernel.now() + 100 * MS)
    send("SETTING", index=0, value=0.0)  # the default list of messages
    kernel.run(kernel.now() + 100 * MS)
    received.clear()
    kernel.run(kernel.now() + 3 * S)
    assert {"ROTORCRAFT_FP", "ROTORCRAFT_STATUS", "ROTORCRAFT_NAV_STATUS"} <= {one.name for one in received}
    state = autopilot.state()
    assert isfinite(state.x + state.y + state.z)
    assert autopilot.vehicle.armed is False or autopilot.vehicle.mode.name != "KILL"
