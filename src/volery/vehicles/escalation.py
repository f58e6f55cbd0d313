"""What a vehicle does after a monitor has ended an operation: reactions of increasing rank.

The first reaction depends on what was found; the next one follows when the one before has shown no effect in
its time. By default a vehicle holds, then lands. The motors are stopped in the air only where the user has
stated that as the last reaction. A vehicle that another station controls is left alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from volery.base.errors import (
    CriticalBattery,
    LinkError,
    Overridden,
    ThrustSaturated,
    UsageError,
    VehicleError,
    VoleryError,
)
from volery.base.time import Ns, from_seconds
from volery.vehicles.driver import Capability, Driver, Step

SINKING_M, SINKING_M_S = 0.5, 0.2
"""A landing has an effect if the vehicle has sunk by this, or sinks at this speed."""
NEAR_GROUND_M = 1.0
"""Height above home below which the ground may be near; a landing is then given its whole time."""


class Reaction(Enum):
    """A reaction of a vehicle; the value is what it is commanded to do."""

    HOLD = "hold"
    LAND = "land"
    KILL = "stop its motors"


_RANKS = tuple(Reaction)
_DONE = {
    Reaction.HOLD: "it holds there",
    Reaction.LAND: "it is on the ground",
    Reaction.KILL: "its motors were stopped",
}
_FIRST: tuple[tuple[type[VehicleError], Reaction], ...] = (
    (CriticalBattery, Reaction.LAND),
    (ThrustSaturated, Reaction.LAND),
)
"""The first reaction to an error; to all others it is to hold."""


@dataclass(frozen=True)
class Escalation:
    """Which reactions are allowed, and how long each has to show an effect.

    Args:
        reactions: reactions in increasing rank: hold, land, and stop the motors only if it is stated.
        time_to_act: time in which a vehicle that is to hold stands, and one that is to land sinks, s.
    """

    reactions: tuple[Reaction, ...] = (Reaction.HOLD, Reaction.LAND)
    time_to_act: float = 10.0

    def __post_init__(self) -> None:
        ranks = [_RANKS.index(reaction) for reaction in self.reactions]
        if not ranks or ranks != sorted(set(ranks)):
            raise UsageError(f"{self}: state reactions in increasing rank, as (Reaction.HOLD, Reaction.LAND)")
        if not self.time_to_act > 0.0:
            raise UsageError(f"time_to_act={self.time_to_act!r}: give seconds, above 0")

    def after(self, error: VehicleError, capabilities: frozenset[Capability]) -> tuple[Reaction, ...]:
        """Return the reactions to *error* in the order in which they are tried."""
        first = next((reaction for kind, reaction in _FIRST if isinstance(error, kind)), Reaction.HOLD)
        able = [
            reaction
            for reaction in self.reactions
            if reaction is not Reaction.LAND or Capability.LAND in capabilities
        ]
        wanted = [one for one in able if _RANKS.index(one) >= _RANKS.index(first)]
        return tuple(wanted or able[-1:])

    def steps(self, reaction: Reaction, driver: Driver, within: Ns) -> Sequence[Step]:
        """Return the steps of a reaction, which end early where they show no effect.

        Args:
            reaction: the reaction.
            driver: the driver of the vehicle.
            within: time-out of a landing, ns.
        """
        if reaction is Reaction.KILL:
            return driver.disarm(True)
        limit = from_seconds(self.time_to_act)
        if reaction is Reaction.HOLD:
            return [replace(step, within=min(step.within, limit)) for step in driver.hold()]
        steps = list(driver.land(within))
        if steps:
            steps[-1] = replace(steps[-1], fails=_without_effect(driver, limit, steps[-1].fails))
        return steps


def _without_effect(driver: Driver, limit: Ns, fails: Callable[[], str]) -> Callable[[], str]:
    """Return a function that returns why a landing has no effect; empty while it may have one."""
    seen = driver.telemetry
    began: Ns | None = None
    height = seen.above_home

    def without_effect() -> str:
        nonlocal began
        now = seen.last_message_ns
        began = now if began is None else began
        sinks = seen.velocity.up < -SINKING_M_S or seen.above_home < height - SINKING_M
        if sinks or not seen.flying or not seen.above_home > NEAR_GROUND_M:
            began = now
        return "it does not sink" if now - began >= limit else fails()

    return without_effect


def escalate(
    escalation: Escalation,
    error: VehicleError,
    capabilities: frozenset[Capability],
    perform: Callable[[Reaction], None],
) -> str:
    """Carry out reactions to *error* until one has an effect; return what was done, in words.

    Args:
        escalation: the allowed reactions.
        error: what was found.
        capabilities: what the vehicle can do.
        perform: carries out a reaction; raises ``VoleryError`` if it shows no effect.
    """
    said = []
    for reaction in escalation.after(error, capabilities):
        try:
            perform(reaction)
        except VoleryError as problem:
            said.append(f"it did not {reaction.value}: {problem}")
            if isinstance(problem, Overridden | LinkError):
                break
            continue
        said.append(_DONE[reaction])
        break
    return "; ".join(said)
