"""The safety switch over random sequences of what is received."""

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.base.errors import UsageError
from volery.control.safety_switch import (
    Authority,
    KnownInputs,
    SafetyReaction,
    SafetyState,
    SwitchSettings,
    decide,
    parse_reaction,
)

MANUAL, AUTONOMOUS, LANDING = Authority
pulses = st.one_of(st.integers(800, 2200), st.sampled_from([0, 65535, 1199, 1200, 1700, 1701]))
looks = st.builds(
    KnownInputs, pulses, st.sampled_from([0.0, 0.1, 0.99, 1.5, inf]), st.sampled_from([0.0, 0.5, 3.0])
)
settings_of = st.builds(
    SwitchSettings,
    on_rc_loss=st.sampled_from(SafetyReaction),
    on_telemetry_loss=st.sampled_from([SafetyReaction.LAND, SafetyReaction.RELEASE]),
)


def at(pulse: int) -> KnownInputs:
    return KnownInputs(pulse, 0.05, 0.05)


DEFAULT = SwitchSettings()


def after(*received: KnownInputs, settings: SwitchSettings = DEFAULT) -> SafetyState:
    state = SafetyState()
    for one in received:
        state = decide(settings, state, one)
    return state


@given(settings_of, st.lists(looks, max_size=40))
def test_a_received_low_switch_takes_over_from_every_state(settings, sequence):
    assert after(*sequence, at(1000), settings=settings).authority is MANUAL


def test_one_report_that_is_looked_at_twice_begins_no_landing():
    middle, high = at(1500), at(1900)
    assert after(middle, high, high._replace(new=False), high._replace(new=False)).authority is AUTONOMOUS
    assert after(middle, high, high._replace(new=False), high).authority is LANDING


@given(settings_of, st.lists(looks, max_size=40))
def test_the_program_gets_control_only_by_a_fresh_middle_position(settings, sequence):
    state = SafetyState()
    for one in sequence:
        before, state = state, decide(settings, state, one)
        if state.authority is AUTONOMOUS and before.authority is not AUTONOMOUS:
            assert 1250 <= one.pulse <= 1650
            assert one.age_s <= settings.missing_s
            assert one.silent_s <= settings.silent_s


@given(settings_of, st.lists(looks, max_size=40))
def test_an_emergency_landing_ends_by_a_takeover_only(settings, sequence):
    state = SafetyState()
    for one in sequence:
        before, state = state, decide(settings, state, one)
        if before.authority is LANDING and state.authority is not LANDING:
            assert state.authority is MANUAL
            assert one.valid
            assert one.pulse < settings.manual_below


@given(settings_of, st.lists(looks, max_size=40))
def test_after_a_takeover_nothing_but_the_switch_gives_control_back(settings, sequence):
    """Neither a loss nor the landing position begins anything that the transmitter has ended."""
    state = after(at(1500), at(1000))
    for one in sequence:
        state = decide(settings, state, one)
        if state.authority is AUTONOMOUS:
            assert one.valid
            break
        assert state.authority is MANUAL


def test_the_positions_of_the_thesis():
    assert [after(at(1500), at(one), at(one)).authority for one in (1199, 1200, 1450, 1700, 1701)] == [
        MANUAL, AUTONOMOUS, AUTONOMOUS, AUTONOMOUS, LANDING,
    ]  # fmt: skip


LATE = KnownInputs(1500, 1.05, 0.05, new=False)


@pytest.mark.parametrize(
    "bad", [at(1900), at(0), at(65535), at(2201), LATE, KnownInputs(1500, 0.05, 2.05, new=False)]
)
def test_one_wrong_report_does_not_land(bad):
    assert after(at(1500), bad, at(1500)).authority is AUTONOMOUS
    assert after(at(1500), bad, at(1500), bad, at(1500)).authority is AUTONOMOUS


bad_reports = st.sampled_from([at(0), at(65535), at(2201), at(1701), at(2200), LATE])


@given(settings_of, st.lists(st.tuples(st.integers(1250, 1650), bad_reports), max_size=40))
def test_wrong_reports_that_are_never_two_in_a_row_end_nothing(settings, pairs):
    sequence = [one for pulse, bad in pairs for one in (at(pulse), bad)]
    assert after(at(1500), *sequence, settings=settings).authority is AUTONOMOUS


@given(st.lists(st.integers(1151, 1249), max_size=60))
def test_a_switch_held_at_the_border_is_taken_over_once(held):
    state, changes = after(at(1500)), 0
    for pulse in held:
        before, state = state, decide(DEFAULT, state, at(pulse))
        changes += state.authority is not before.authority
    assert changes <= 1
    assert state.authority is (MANUAL if any(pulse < 1200 for pulse in held) else AUTONOMOUS)


@pytest.mark.parametrize(
    ("reaction", "expected"),
    [(SafetyReaction.LAND, LANDING), (SafetyReaction.RELEASE, MANUAL), (SafetyReaction.CONTINUE, AUTONOMOUS)],
)
@pytest.mark.parametrize(
    "lost", [[KnownInputs(1500, 1.5, 0.0, new=False)], [at(0), at(0)], [at(65535), at(2201)]]
)
def test_a_lost_transmitter_has_the_configured_reaction(reaction, expected, lost):
    state = after(at(1500), *lost, settings=SwitchSettings(on_rc_loss=reaction))
    assert state.authority is expected


@pytest.mark.parametrize(
    ("reaction", "expected"), [(SafetyReaction.LAND, LANDING), (SafetyReaction.RELEASE, MANUAL)]
)
def test_lost_telemetry_has_the_configured_reaction(reaction, expected):
    state = after(at(1500), KnownInputs(1500, 2.5, 2.5), settings=SwitchSettings(on_telemetry_loss=reaction))
    assert state.authority is expected
    assert "telemetry" in state.why


def test_a_switch_that_is_stuck_high_at_the_start_never_flies():
    assert after(*[at(1900)] * 20).authority is MANUAL


@pytest.mark.parametrize(
    "wrong",
    [
        {"channel": 0},
        {"manual_below": 1800},
        {"manual_below": 1600},
        {"missing_s": nan},
        {"silent_s": 0.0},
        {"on_telemetry_loss": SafetyReaction.CONTINUE},
    ],
)
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(UsageError, match="switch"):
        SwitchSettings(**wrong)


def test_an_unknown_reaction_is_named():
    assert parse_reaction("release") is SafetyReaction.RELEASE
    with pytest.raises(UsageError, match="'fly'; there is continue, land or release"):
        parse_reaction("fly")
