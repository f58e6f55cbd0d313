"""What an aircraft's messages become, number by number; and that none of them can do harm."""

from __future__ import annotations

from math import degrees, isnan, pi
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.pprzlink_codec import PPRZLINK
from volery.links.pprzlink_messages import TELEMETRY, PayloadField, message_names, message_type
from volery.vehicles.drivers.paparazzi import open_driver

ORIGIN = {"lat0": 434622222, "lon0": 12733333, "alt0": 233_500, "hmsl0": 185_000}
STATUS = {"ap_mode": 13, "gps_status": 3, "arming_status": 1, "vsupply": 12.25}
AIRCRAFT = 7


class Listener:
    """A driver and a way to say things to it."""

    def __init__(self) -> None:
        self.kernel = VirtualKernel()
        ours, self.theirs = in_process_pair(self.kernel, codec=PPRZLINK)
        self.driver = open_driver(self.kernel, ours, "craft_1", {})
        self.seen = self.driver.telemetry

    def hear(self, name: str, source: int = AIRCRAFT, **fields: Any) -> None:
        self.theirs.send(Frame(name, fields, source, 0))
        self.kernel.run(self.kernel.now() + S // 10)


@pytest.fixture
def listener() -> Listener:
    return Listener()


def test_a_position_is_scaled_and_placed(listener: Listener) -> None:
    listener.hear("ROTORCRAFT_STATUS", **STATUS)
    listener.hear("INS_REF", **ORIGIN)
    listener.hear(
        "ROTORCRAFT_FP",
        east=-256 * 20,
        north=256 * 10,
        up=128,
        veast=2**18,
        vnorth=-(2**19),
        vup=2**17,
        phi=round(0.1 * 4096),
        theta=round(-0.2 * 4096),
        psi=round(-pi / 2 * 4096),
    )
    seen = listener.seen
    assert seen.position is not None
    east, north, up = LocalFrame(43.4622222, 1.2733333, 233.5).to_enu(
        seen.position.latitude, seen.position.longitude, seen.position.altitude.metres + 48.5
    )
    assert (east, north, up) == pytest.approx((-20.0, 10.0, 0.5), abs=1e-6)
    assert seen.above_home == pytest.approx(0.5, abs=1e-3)
    assert seen.velocity == (-1.0, 0.5, 0.25)
    assert seen.attitude == pytest.approx((degrees(0.1), degrees(-0.2), 270.0), abs=0.02)


def test_there_is_no_position_without_an_origin(listener: Listener) -> None:
    listener.hear("ROTORCRAFT_FP", east=256)
    listener.hear("INS_REF")
    listener.hear("ROTORCRAFT_FP", east=256)
    assert listener.seen.position is None
    assert listener.seen.home is None


def test_home_is_the_waypoint_that_is_called_so(listener: Listener) -> None:
    listener.hear("INS_REF", **ORIGIN)
    home = listener.seen.home
    assert home is not None
    assert (home.latitude, home.longitude) == pytest.approx((43.4622222, 1.2733333), abs=1e-9)
    assert home.altitude.metres == 185.0
    listener.hear("WP_MOVED_ENU", wp_id=2, east=256 * 100)
    assert listener.seen.home == home
    listener.hear("WP_MOVED_ENU", wp_id=1, east=256 * 100, up=256 * 50)
    moved = listener.seen.home
    assert moved is not None
    assert moved.longitude > home.longitude
    assert moved.altitude.metres == 185.0


def test_the_link_counts_once_the_kind_is_known(listener: Listener) -> None:
    listener.hear("ALIVE", md5sum=(1, 2))
    listener.hear("ROTORCRAFT_FP")
    assert listener.seen.last_message_ns == -1
    listener.hear("ROTORCRAFT_STATUS", **STATUS)
    seen = listener.seen
    assert (seen.kind, seen.autopilot, seen.mode) == ("drone", "Paparazzi", "NAV")
    assert (seen.fix, seen.status, seen.armed, seen.flying) == ("3d", "waiting", False, False)
    assert seen.battery.volts == 12.25
    assert isnan(seen.battery.remaining)


def test_motors_that_are_off_do_not_fly(listener: Listener) -> None:
    listener.hear("ROTORCRAFT_STATUS", **STATUS, ap_in_flight=1)
    assert not listener.seen.flying
    listener.hear("ROTORCRAFT_STATUS", **STATUS, ap_in_flight=1, ap_motors_on=1)
    assert listener.seen.flying


def test_other_aircraft_on_the_same_radio_are_ignored(listener: Listener) -> None:
    listener.hear("ROTORCRAFT_STATUS", **STATUS)
    listener.hear("ROTORCRAFT_STATUS", source=8, ap_mode=19)
    assert listener.seen.mode == "NAV"


def test_commands_of_another_ground_station_are_no_telemetry(listener: Listener) -> None:
    listener.hear("SETTING", source=0, index=3, ac_id=AIRCRAFT, value=19.0)
    listener.hear("GUIDED_SETPOINT_NED", source=0, ac_id=AIRCRAFT)
    assert listener.seen.last_message_ns == -1


def test_words_of_the_aircraft(listener: Listener) -> None:
    listener.hear("INFO_MSG", msg="mission: point 3")
    listener.hear("ENERGY", voltage=12.5, current=3.5)
    listener.hear("GPS_INT", numsv=11)
    assert listener.seen.texts[-1].text == "mission: point 3"
    assert listener.seen.battery[1:] == (12.5, 3.5)
    assert listener.seen.satellites == 11


INTEGERS = {"b": (-128, 127), "B": (0, 255), "h": (-(2**15), 2**15 - 1), "H": (0, 2**16 - 1)}
INTEGERS |= {"i": (-(2**31), 2**31 - 1), "I": (0, 2**32 - 1)}


def values(field: PayloadField) -> st.SearchStrategy[Any]:
    if field.text:
        return st.text(max_size=40)
    one: st.SearchStrategy[Any] = (
        st.integers(*INTEGERS[field.code]) if field.code in INTEGERS else st.floats(width=32)
    )
    return st.lists(one, max_size=20).map(tuple) if field.length else one


@st.composite
def telemetry(draw: st.DrawFn) -> Frame:
    names = [name for name in message_names() if message_type(name).kind == TELEMETRY]
    kind = message_type(draw(st.sampled_from(names)))
    return Frame(kind.name, {field.name: draw(values(field)) for field in kind.fields}, AIRCRAFT, 0)


@settings(max_examples=150, deadline=None)
@given(st.lists(telemetry(), max_size=12))
def test_no_message_does_harm(frames: list[Frame]) -> None:
    listener = Listener()
    for frame in frames:
        listener.hear(frame.name, **frame.fields)
    listener.kernel.run(listener.kernel.now() + 3 * S)
    assert listener.driver.problem() is None or str(listener.driver.problem())
    assert isinstance(listener.driver.on_link_loss(), str)


def test_the_mode_switch_of_the_transmitter_is_channel_5(listener: Listener) -> None:
    sticks = {"roll": 9600, "pitch": -4800, "yaw": 0, "throttle": 9600, "kill": 9600}
    for mode, pulse in ((9600, 1500), (0, 1000), (-9600, 1000)):
        listener.hear("ROTORCRAFT_RADIO_CONTROL", **sticks, mode=mode, status=0)
        assert tuple(listener.seen.rc) == (2000, 1250, 2000, 1500, pulse, 2000)
        assert listener.seen.rc_ns >= 0
    listener.hear("ROTORCRAFT_RADIO_CONTROL", **sticks, mode=9600, status=1)
    assert set(listener.seen.rc) == {0}  # the transmitter is lost
