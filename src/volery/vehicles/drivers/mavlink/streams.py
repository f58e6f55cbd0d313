"""Asking for the messages that are used, and again for those that do not come.

ArduPilot streams nothing unasked but heartbeats and texts; what is asked for within the first moments of its
life it acknowledges and forgets.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from volery.base.time import Ns, S

ASK_AGAIN: Ns = 3 * S
MISSED = 3
"""Periods without a message after which it counts as not coming."""


class Streams:
    """``ask(message, period)`` is called for what does not come. Look at it once a second."""

    def __init__(self, periods: Mapping[str, Ns], ask: Callable[[str, Ns], None]) -> None:
        self._periods = dict(periods)
        self._ask = ask
        self._heard: dict[str, Ns] = {}
        self._asked: dict[str, Ns] = {}

    def want(self, message: str, period: Ns) -> None:
        """This, too, from now on."""
        self._periods[message] = period

    def heard(self, message: str, now: Ns) -> None:
        """It has come."""
        if message in self._periods:
            self._heard[message] = now

    def look(self, now: Ns) -> None:
        """Ask for what is missing."""
        for message, period in self._periods.items():
            heard = self._heard.get(message)
            comes = heard is not None and now - heard <= MISSED * period + S
            asked = self._asked.get(message)
            if not comes and (asked is None or now - asked >= ASK_AGAIN):
                self._asked[message] = now
                self._ask(message, period)
