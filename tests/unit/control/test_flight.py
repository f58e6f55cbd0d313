"""Flights under control laws on a simulated ArduCopter: the switch, the landing, losses, both ways to act."""

from __future__ import annotations

from random import Random
from typing import Any

import pytest

from rigs.controlled_flights import Watched, fly_watched
from volery.base.errors import LinkLost, NotArrived, OffTrack, Refused, UsageError
from volery.base.time import from_seconds
from volery.control.actuation import RC_SCALES, MotionCommand, RcAxis
from volery.control.flight import limited_descent
from volery.control.laws import PidGains, wrap
from volery.control.manoeuvres import Altitude, Rotation, Waypoints, cube, set_gains
from volery.control.safety_switch import Emergency, SafetyReaction, SwitchSettings
from volery.simulation.autopilots.px4.flight_modes import apply_expo
from volery.vehicles import Drone

SWITCH = SwitchSettings()
BOTH = pytest.mark.parametrize("by", ["setpoints", "rc"])
ALL = pytest.mark.parametrize("by", ["setpoints", "attitude", "rc"])
REPORT_S, DELAY_S = 0.05, 0.01
SETTLED_S = REPORT_S + DELAY_S
"""Time after which a moved switch has its effect: one report of RC channels, and the link there and back."""


def rotation() -> Rotation:
    return Rotation([0.0, 90.0], 6.0)


def landed_gently(flown: Watched) -> bool:
    return not flown.end.armed and flown.end.height < 0.3 and flown.touch_down < 1.0


@ALL
def test_a_turn_is_flown_and_the_drone_lands(by: str) -> None:
    flown = fly_watched(rotation, [(0.0, 1500)], by=by, switch=SWITCH)
    assert flown.error is None
    assert landed_gently(flown)
    assert flown.looks[-1].at < 45.0
    yaw = [one for one in flown.samples if one.loop == "yaw"]
    assert abs(yaw[-1].error) < 0.5
    assert yaw[-1].output == pytest.approx(yaw[-1].proportional + yaw[-1].integral + yaw[-1].derivative)


@BOTH
@pytest.mark.parametrize("at", [1.5, 6.0, 14.0])
def test_an_emergency_landing_in_every_phase(by: str, at: float) -> None:
    """At the start of the motors, while it climbs, and while it turns."""
    flown = fly_watched(rotation, [(0.0, 1500), (at, 1900)], by=by, switch=SWITCH)
    assert landed_gently(flown)
    assert flown.authority == "emergency landing"
    assert flown.end.at < at + 20.0


@BOTH
def test_an_emergency_landing_over_a_slow_and_lossy_radio(by: str) -> None:
    slow = "&wire=bytes&baud=57600&drop=0.02&flip=1e-5"
    flown = fly_watched(rotation, [(0.0, 1500), (14.0, 1900)], by=by, switch=SWITCH, options=slow)
    assert landed_gently(flown)
    assert flown.authority == "emergency landing"


def overrides_after_release(flown: Watched) -> list[float]:
    """Return the times at which a channel was overridden although the switch had been low long enough."""
    wrong, low_since = [], None
    for one in flown.looks:
        low_since = (
            None if one.switch >= SWITCH.manual_below else low_since if low_since is not None else one.at
        )
        if low_since is not None and one.at - low_since > SETTLED_S and one.overridden:
            wrong.append(one.at)
    return wrong


@BOTH
@pytest.mark.parametrize("seed", range(4))
def test_never_two_masters_over_random_switch_sequences(by: str, seed: int) -> None:
    """While the switch is low no channel is overridden, and the autopilot follows no computer."""
    random = Random(seed)
    moves, at = [(0.0, 1500)], 2.0
    while at < 25.0:
        at += random.uniform(0.1, 4.0)
        moves.append((at, random.choice([1000, 1000, 1150, 1250, 1500, 1600, 1750, 1900])))
    flown = fly_watched(rotation, moves, by=by, switch=SWITCH, limit_s=40.0)
    assert overrides_after_release(flown) == []
    manual_for = 0.0
    for before, now in zip(flown.looks, flown.looks[1:], strict=False):
        manual_for = manual_for + now.at - before.at if now.switch < SWITCH.manual_below else 0.0
        # a change of mode is a command with an answer
        assert not (manual_for > SETTLED_S + 0.1 and now.armed and now.mode == "GUIDED"), now


@ALL
def test_control_that_was_given_back_continues_the_flight(by: str) -> None:
    moves = [(0.0, 1500), (13.0, 1000), (14.0, 1500)]
    flown = fly_watched(lambda: Rotation([0.0, 90.0], 8.0), moves, by=by, switch=SWITCH)
    assert flown.error is None
    assert landed_gently(flown)
    assert abs([one for one in flown.samples if one.loop == "yaw"][-1].error) < 1.0


@pytest.mark.parametrize("pulse", [1000, 1900, 0])
def test_without_the_middle_position_nothing_starts(pulse: int) -> None:
    flown = fly_watched(rotation, [(0.0, pulse)], switch=SWITCH)
    assert isinstance(flown.error, NotArrived)
    assert "channel 6" in str(flown.error)
    assert not any(one.armed for one in flown.looks)


@pytest.mark.parametrize(
    ("reaction", "authority"),
    [(SafetyReaction.LAND, "emergency landing"), (SafetyReaction.RELEASE, "manual")],
)
def test_a_lost_transmitter_has_its_reaction(reaction: SafetyReaction, authority: str) -> None:
    switch = SwitchSettings(on_rc_loss=reaction)
    flown = fly_watched(rotation, [(0.0, 1500), (13.0, 0)], by="rc", switch=switch, limit_s=40.0)
    assert flown.authority == authority
    assert not flown.end.overridden


def test_with_the_link_lost_the_autopilot_lands_by_its_failsafe() -> None:
    cut = "&wire=bytes&cut=13-100&parameters=FS_GCS_ENABLE:5"
    flown = fly_watched(rotation, [(0.0, 1500)], switch=SWITCH, options=cut, after_s=30.0)
    assert isinstance(flown.error, LinkLost)
    assert landed_gently(flown)


@ALL
@pytest.mark.parametrize("after", [0.15, 2.0, 6.0])
def test_an_emergency_landing_needs_no_link_once_it_has_begun(by: str, after: float) -> None:
    """With default parameters: LAND is sent first, so that a link that is lost then does no harm."""
    cut = f"&wire=bytes&cut={13.0 + after}-100"
    flown = fly_watched(
        rotation, [(0.0, 1500), (13.0, 1900)], by=by, switch=SWITCH, options=cut, after_s=40.0
    )
    assert flown.authority == "emergency landing"
    assert landed_gently(flown)


def test_the_law_flies_the_emergency_landing_where_stated() -> None:
    switch = SwitchSettings(emergency=Emergency.RAMP)
    flown = fly_watched(rotation, [(0.0, 1500), (13.0, 1900)], by="rc", switch=switch)
    assert any(one.loop == "landing" for one in flown.samples)
    assert landed_gently(flown)


def test_the_law_lands_where_the_autopilot_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    refusals = []
    land = Drone.land

    def refuse_once(drone: Drone) -> None:
        if not refusals:
            refusals.append(drone.mode)
            raise Refused(drone.name, "land", "LAND requires a position")
        land(drone)

    monkeypatch.setattr(Drone, "land", refuse_once)
    flown = fly_watched(rotation, [(0.0, 1500), (13.0, 1900)], by="rc", switch=SWITCH)
    assert refusals
    assert any("the law lands it" in text for text in flown.texts)
    assert any(one.loop == "landing" for one in flown.samples)
    assert landed_gently(flown)


@ALL
def test_with_rc6_option_18_the_autopilot_obeys_the_switch_without_a_link(by: str) -> None:
    cut = "&wire=bytes&cut=13-100&parameters=RC6_OPTION:18"
    flown = fly_watched(
        rotation, [(0.0, 1500), (13.5, 1900)], by=by, switch=SWITCH, options=cut, after_s=40.0
    )
    assert isinstance(flown.error, LinkLost)
    assert landed_gently(flown)


def test_a_link_lost_in_a_descent_does_not_end_in_a_hard_touch_down() -> None:
    """RC override, default parameters: the last command lasts for 3 s, then the sticks of the transmitter."""

    def centre(fleet: Any, _drone: Drone) -> None:
        fleet.move_transmitter("ardupilot", from_seconds(9.0), 3, 1500)

    for at in (17.0, 18.5, 20.0, 21.5):
        cut = f"&wire=bytes&cut={at}-100"
        flown = fly_watched(
            lambda: Altitude([8.0, 1.0], 8.0),
            [(0.0, 1500)],
            by="rc",
            switch=SWITCH,
            options=cut,
            after_s=10.0,
            during=centre,
        )
        assert isinstance(flown.error, LinkLost)
        assert flown.touch_down < 1.0, at


def test_a_descent_may_last_until_the_last_command_ends() -> None:
    fast = MotionCommand(1.0, 2.0, -1.5, 3.0)
    assert limited_descent(fast, 20.0) == fast
    assert limited_descent(fast, 4.5).up == pytest.approx(-1.0)
    assert limited_descent(fast, 0.2).up == limited_descent(fast, float("nan")).up == -0.8
    assert limited_descent(fast._replace(up=2.0), 0.2).up == 2.0


def test_a_low_throttle_stick_is_recorded_before_the_sticks_are_taken() -> None:
    low = fly_watched(rotation, [(0.0, 1500)], by="rc", switch=SWITCH)
    assert any("throttle, at 1000 us" in text for text in low.texts)


def test_lost_telemetry_that_returns_ends_in_a_landing() -> None:
    flown = fly_watched(rotation, [(0.0, 1500)], switch=SWITCH, options="&wire=bytes&cut=13-16.5")
    assert flown.authority == "emergency landing"
    assert landed_gently(flown)


@ALL
def test_the_corners_of_a_cube(by: str) -> None:
    points = cube(3.0, 4.0)
    made: list[Waypoints] = []

    def make() -> Waypoints:
        made.append(Waypoints(points, tolerance=0.05, hold_s=0.5))
        return made[0]

    flown = fly_watched(make, by=by, limit_s=200.0)
    assert flown.error is None
    assert len(made[0].corners) == len(points)
    assert max(one.error for one in made[0].corners) <= 0.05


def overshoot(flown: Watched) -> float:
    """Return by how many degrees the last turn, clockwise, went too far."""
    yaw = [one for one in flown.samples if one.loop == "yaw" and one.goal == 90.0]
    return max(0.0, *(float(wrap(one.measurement - one.goal)) for one in yaw))


def test_the_yaw_loops_swing_as_those_of_arducopter(monkeypatch: pytest.MonkeyPatch) -> None:
    """A law on the measured heading alone overshot by 10.3 % on the real one, which swung for 8 s."""
    plain = RC_SCALES["ArduPilot"]._replace(turning=None)
    monkeypatch.setitem(RC_SCALES, "ArduPilot", plain)  # type: ignore[arg-type]  # it is a dict
    flown = fly_watched(
        lambda: Rotation([0.0, 90.0], 10.0), [(0.0, 1500)], by="rc", switch=SWITCH, as_stated=True
    )
    assert 6.0 < overshoot(flown) < 14.0


@ALL
def test_a_turn_hardly_overshoots(by: str) -> None:
    flown = fly_watched(lambda: Rotation([0.0, 90.0], 5.0), [(0.0, 1500)], by=by, switch=SWITCH)
    most = 0.08 if by == "attitude" else 0.05  # ArduCopter 4.8 itself: 5.7 and 7.3 % by attitude
    assert overshoot(flown) < most * 90.0


def test_heights() -> None:
    flown = fly_watched(lambda: Altitude([7.0], 10.0), by="rc")
    assert [one for one in flown.samples if one.loop == "altitude"][-1].measurement == pytest.approx(
        7.0, abs=0.1
    )


@pytest.mark.parametrize("make", [rotation, lambda: Altitude([9.0], 20.0)])
def test_attitudes_that_an_autopilot_ignores_are_noticed(make, monkeypatch: pytest.MonkeyPatch) -> None:
    """As ArduCopter from 4.6 on ignores those without all rates: no error, no effect."""
    monkeypatch.setattr(Drone, "set_attitude", lambda *_, **__: None)
    flown = fly_watched(make, by="attitude", limit_s=80.0)
    assert isinstance(flown.error, OffTrack)
    assert "it does not follow" in str(flown.error)
    assert "were asked for within 2.5 s, " in str(flown.error)
    assert landed_gently(flown)
    assert flown.end.at < 40.0


def test_a_landing_law_that_does_not_sink_is_taken_over_by_the_autopilot(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    velocity = Drone.set_velocity

    def keep_height(drone: Drone, north: float, east: float, up: float, turn: float, **more: float) -> None:
        velocity(drone, north, east, max(0.0, up), turn, **more)

    monkeypatch.setattr(Drone, "set_velocity", keep_height)
    flown = fly_watched(lambda: Rotation([0.0], 3.0), limit_s=80.0)
    assert flown.error is None
    assert any(
        "the landing law: it does not follow: -2.0 m up" in one and "the autopilot lands it" in one
        for one in flown.texts
    )
    assert landed_gently(flown)


def test_a_way_point_that_is_never_held_is_given_up() -> None:
    flown = fly_watched(lambda: Waypoints([(0.0, 0.0, 4.0)], tolerance=1e-4, hold_s=5.0), limit_s=200.0)
    assert "way point 1 of 1 was not held within 0.0001 m" in str(flown.error)
    assert landed_gently(flown)


# -- channels and bad input


def test_a_channel_jumps_over_its_dead_band() -> None:
    axis = RC_SCALES["ArduPilot"].turn
    assert axis.pulse(0.0) == 1500.0
    assert axis.pulse(0.1) > 1520.0
    assert axis.pulse(-0.1) < 1480.0
    assert (axis.pulse(1000.0), axis.pulse(-1000.0)) == (2000.0, 1000.0)
    assert axis.position(202.5) == pytest.approx(1.0)


@pytest.mark.parametrize("climb", [-1.5, -0.7, -0.05, 0.0, 0.05, 1.0, 3.0])
def test_a_climb_rate_arrives_through_the_expo_curve_of_a_px4(climb: float) -> None:
    stick = RC_SCALES["PX4"].climb.position(climb)
    most = 3.0 if climb > 0.0 else 1.5
    assert most * apply_expo(stick, dead=0.1) == pytest.approx(climb)


@pytest.mark.parametrize(
    "wrong", [{"per_unit": 0.0}, {"per_unit": 1.0, "trim": 2500.0}, {"per_unit": 1.0, "dead": -1.0}]
)
def test_a_wrong_channel_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="RC channel"):
        RcAxis(**wrong)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Rotation([]), "at least one heading"),
        (lambda: Rotation([float("nan")]), "at least one heading"),
        (lambda: Rotation([0.0], 0.0), "time above 0"),
        (lambda: Altitude([-1.0]), "above 0 m"),
        (lambda: Waypoints([]), "at least one"),
        (lambda: Waypoints([(0.0, 0.0, 5.0)], tolerance=0.0), "tolerance"),
        (lambda: set_gains(Rotation([0.0]), "roll", PidGains()), "there is yaw"),
    ],
)
def test_wrong_manoeuvres_are_refused(make, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        make()
