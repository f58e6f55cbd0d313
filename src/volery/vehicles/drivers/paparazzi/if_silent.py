"""What a Paparazzi rotorcraft will do if its commander falls silent, in words, from its flight plan.

Facts: in GUIDED nothing is missed: neither ground nor transmitter nor, so the sources, a fence. In NAV the
plan's own rules hold. Modes that sticks fly become FAILSAFE when the sticks stop.
"""

from __future__ import annotations

from volery.links.pprz_aircraft import Aircraft


def if_silent(aircraft: Aircraft) -> str:
    """One line."""
    far = f", further than {aircraft.farthest:g} m from home it turns back" if aircraft.farthest else ""
    return (
        "in GUIDED it misses nobody: it goes to its last set-point and stays there, and a velocity goes on "
        f"without end; in NAV (taking off, landing) it goes on with its plan{far}; flown by sticks it comes "
        "down (FAILSAFE)"
    )
