"""Kinds of operations: who may ask for them when, and what is looked after meanwhile."""

from __future__ import annotations

from dataclasses import dataclass

from volery.vehicles.bounds import FLOOR


@dataclass(frozen=True, kw_only=True)
class Manner:
    """What kind of operation it is.

    ``ours``: refused while somebody else has the vehicle. ``noted`` False: recorded only if it fails; a loop
    of set-points is no list of operations. ``bounded``: watched for bounds; ``goes_on``: still so after it
    has returned, until the next one. ``travels``: not below the battery's reserve. ``by_hand``: sticks keep
    what they are. ``safe``: brings it to safety, so it takes the place of what another task has under way.
    ``excused`` are bounds that do not count.
    """

    ours: bool = True
    noted: bool = True
    bounded: bool = False
    goes_on: bool = False
    travels: bool = False
    by_hand: bool = False
    safe: bool = False
    excused: frozenset[str] = frozenset()


PLAIN = Manner(by_hand=True)
ANYHOW = Manner(by_hand=True, ours=False)
TURN = Manner(bounded=True)
TRAVEL = Manner(bounded=True, travels=True)
MISSION = Manner(bounded=True, travels=True, excused=frozenset({FLOOR}))
STREAM = Manner(bounded=True, travels=True, goes_on=True, noted=False)
BY_HAND = Manner(bounded=True, goes_on=True, by_hand=True)
SAFE = Manner(safe=True)
LAST_RESORT = Manner(safe=True, ours=False)
