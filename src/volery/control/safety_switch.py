"""The operator's safety switch: who has control, as a pure function of what is received.

One RC channel decides (by default channel 6): low is manual takeover, the middle lets the program fly, high
is an emergency landing. The transmitter always wins: a low switch takes over from everything, at once and in
every state. The emergency landing is final, but for the takeover. A program that starts, or that lost
control, flies only after the switch has been received in its middle position.

What is final needs confirmation: one wrong report, or a gap that has just become too long, begins no landing.
A switch at the border between manual and autonomous stays manual.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from math import isnan
from typing import NamedTuple

from volery.base.errors import UsageError, choices


class Authority(Enum):
    """Who has control, and for what."""

    MANUAL = "manual"
    AUTONOMOUS = "autonomous"
    LANDING = "emergency landing"


class SafetyReaction(Enum):
    """What happens when something is lost in the air."""

    LAND = "land"
    RELEASE = "release"
    CONTINUE = "continue"


class Emergency(Enum):
    """Who flies the emergency landing."""

    AUTOPILOT = "autopilot"
    """The autopilot's own landing, which needs no link."""
    RAMP = "ramp"
    """The landing law's descent in steps, as in the thesis, which needs the link to the end."""


AFTER: Mapping[SafetyReaction, Authority] = {
    SafetyReaction.LAND: Authority.LANDING,
    SafetyReaction.RELEASE: Authority.MANUAL,
    SafetyReaction.CONTINUE: Authority.AUTONOMOUS,
}
LEAST_PULSE, GREATEST_PULSE = 800, 2200
"""Range of valid pulse widths, µs; autopilots report 0 or 65535 for a channel without a signal."""
CONFIRMED = 2
"""Reports in a row, of the landing position or without a signal, that count: a single wrong one must not."""
CONFIRMED_AFTER_S = 0.5
"""Time for which a loss must last beyond the age at which it begins."""
HYSTERESIS = 50
"""Distance in us from the borders of the middle position within which control is not given back."""


@dataclass(frozen=True, kw_only=True)
class SwitchSettings:
    """Which channel is the switch, where its positions end, and the reactions to losses.

    Attributes:
        channel: RC channel, from 1.
        manual_below: pulse width below which the transmitter takes over, µs. Control is given back from
            ``HYSTERESIS`` above it.
        landing_above: pulse width above which the emergency landing begins, µs.
        missing_s: age of the last report from which the transmitter may be lost, s; it counts as lost
            ``CONFIRMED_AFTER_S`` later.
        silent_s: likewise the silence of the autopilot from which telemetry may be lost, s.
        on_rc_loss: reaction to the loss of the transmitter.
        on_telemetry_loss: reaction to the loss of telemetry.
        emergency: who flies the emergency landing.
    """

    channel: int = 6
    manual_below: int = 1200
    landing_above: int = 1700
    missing_s: float = 1.0
    silent_s: float = 2.0
    on_rc_loss: SafetyReaction = SafetyReaction.LAND
    on_telemetry_loss: SafetyReaction = SafetyReaction.LAND
    emergency: Emergency = Emergency.AUTOPILOT

    def __post_init__(self) -> None:
        if not 1 <= self.channel <= 18:
            raise UsageError(f"channel {self.channel} of the safety switch; give one from 1 to 18")
        low, high = self.middle
        if not LEAST_PULSE < self.manual_below < low < high < self.landing_above < GREATEST_PULSE:
            raise UsageError(
                f"safety switch: manual below {self.manual_below} and landing above {self.landing_above}; "
                f"give pulse widths between {LEAST_PULSE} and {GREATEST_PULSE} us, the second more than "
                f"{2 * HYSTERESIS} us above the first"
            )
        for name in ("missing_s", "silent_s"):
            if isnan(getattr(self, name)) or getattr(self, name) <= 0.0:
                raise UsageError(f"safety switch: {name}={getattr(self, name)}; give seconds above 0")
        if self.on_telemetry_loss is SafetyReaction.CONTINUE:
            raise UsageError("safety switch: no law can continue without telemetry; give land or release")

    @property
    def middle(self) -> tuple[int, int]:
        """Least and greatest pulse width that give control to the program, µs."""
        return self.manual_below + HYSTERESIS, self.landing_above - HYSTERESIS


def parse_reaction(text: str) -> SafetyReaction:
    """Return the reaction called *text*; ``UsageError`` names the valid ones."""
    for one in SafetyReaction:
        if one.value == text:
            return one
    raise UsageError(f"reaction {text!r}; there is {choices([one.value for one in SafetyReaction])}")


def parse_emergency(text: str) -> Emergency:
    """Return who lands, called *text*; ``UsageError`` names the valid ones."""
    for one in Emergency:
        if one.value == text:
            return one
    raise UsageError(f"emergency landing by {text!r}; there is {choices([one.value for one in Emergency])}")


class SafetyState(NamedTuple):
    """State between two decisions.

    Attributes:
        authority: who has control.
        confirmed: reports of the landing position in a row.
        lost: reports in a row that are late or without a signal.
        why: what led to the authority.
    """

    authority: Authority = Authority.MANUAL
    confirmed: int = 0
    why: str = "the switch was not received in its middle position yet"
    lost: int = 0


class KnownInputs(NamedTuple):
    """What is known at one moment.

    Attributes:
        pulse: pulse width of the switch, µs; 0 if the receiver reports none.
        age_s: age of that report, s; infinite before the first.
        silent_s: time since the last message of the autopilot, s.
        new: whether this report was not looked at before.
    """

    pulse: int
    age_s: float
    silent_s: float
    new: bool = True

    @property
    def valid(self) -> bool:
        """Whether the pulse width is one of a transmitter."""
        return LEAST_PULSE <= self.pulse <= GREATEST_PULSE


def decide(settings: SwitchSettings, state: SafetyState, received: KnownInputs) -> SafetyState:
    """Return the state after one look at what is received.

    Args:
        settings: positions and reactions.
        state: state after the last look.
        received: the present switch and silences.
    """
    late_s = received.silent_s - settings.silent_s
    if late_s > 0.0:
        return _lost(state, received, late_s, settings.on_telemetry_loss, "telemetry is lost")
    late_s = received.age_s - settings.missing_s
    if late_s > 0.0:
        return _lost(state, received, late_s, settings.on_rc_loss, "the transmitter is lost")
    if not received.valid:
        what = f"channel {settings.channel} has no signal"
        return _lost(state, received, 0.0, settings.on_rc_loss, what)
    return _by_position(settings, state._replace(lost=0), received)


def _by_position(settings: SwitchSettings, state: SafetyState, received: KnownInputs) -> SafetyState:
    pulse = received.pulse
    if pulse < settings.manual_below:
        return SafetyState(Authority.MANUAL, 0, f"the switch is at {pulse} us: manual takeover")
    if pulse > settings.landing_above:
        confirmed = state.confirmed + (1 if received.new else 0)
        if state.authority is Authority.AUTONOMOUS and confirmed >= CONFIRMED:
            why = f"the switch is at {pulse} us: emergency landing"
            return SafetyState(Authority.LANDING, confirmed, why)
        return state._replace(confirmed=confirmed)
    low, high = settings.middle
    if state.authority is Authority.MANUAL and low <= pulse <= high:
        return SafetyState(Authority.AUTONOMOUS, 0, f"the switch is at {pulse} us: autonomous")
    return state._replace(confirmed=0)


def _lost(
    state: SafetyState, received: KnownInputs, late_s: float, reaction: SafetyReaction, why: str
) -> SafetyState:
    """Return the state after a loss: it ends autonomous flight only, and never begins one."""
    if state.authority is not Authority.AUTONOMOUS or reaction is SafetyReaction.CONTINUE:
        return state._replace(confirmed=0)
    lost = state.lost + (1 if received.new else 0)
    if lost < CONFIRMED and late_s < CONFIRMED_AFTER_S:
        return state._replace(confirmed=0, lost=lost)
    return SafetyState(AFTER[reaction], 0, f"{why}: {reaction.value}")
