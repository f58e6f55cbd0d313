"""Forwarding of messages from one link of an autopilot to the others, by the rules of ArduPilot.

The source of the rules is MAVLink_routing of ArduPilot: a link is known by the systems and components that
have been received on it; heartbeats go to all other links, messages with a target to the links of the target,
messages without one to all links on which anything is known. Private links neither give nor get, except what
is addressed to a component behind them.
"""

from __future__ import annotations

from collections.abc import Sequence

from volery.links.frame import Frame
from volery.simulation.autopilots.mavlink.channel import AUTOPILOT, MavlinkChannel

NOT_FORWARDED = ("ADSB_VEHICLE", "RADIO", "RADIO_STATUS")
BROADCAST = 0
MOST_KNOWN = 20
"""Senders that are remembered (MAVLINK_MAX_ROUTES of ArduPilot 4.5)."""

Sender = tuple[int, int]
"""System and component."""


class Routes:
    """Which systems and components have been received on which link, since a boot.

    Args:
        own: System id of the autopilot.
        private: Numbers of the private links.
    """

    def __init__(self, own: int, private: frozenset[int]) -> None:
        self._own = own
        self._private = private
        self._known: dict[Sender, list[int]] = {}
        """Numbers of the links on which a sender was received."""

    def forward(self, origin: MavlinkChannel, frame: Frame, channels: Sequence[MavlinkChannel]) -> None:
        """Take note of a frame's sender, and send the frame on.

        Args:
            origin: The link on which the frame arrived.
            frame: The frame.
            channels: All links.
        """
        sender = frame.system, frame.component
        if sender == (self._own, AUTOPILOT):
            return
        seen_on = self._known.get(sender, [])
        if sender not in self._known and len(self._known) < MOST_KNOWN:
            self._known[sender] = seen_on
        if origin.index not in seen_on:
            seen_on.append(origin.index)
        if origin.index in self._private or frame.name in NOT_FORWARDED:
            return
        wanted = self._others(seen_on) if frame.name == "HEARTBEAT" else self._links_of_target(frame)
        for channel in channels:
            if channel is not origin and channel.index in wanted:
                channel.pass_on(frame)

    def _others(self, seen_on: list[int]) -> set[int]:
        """Return the links that are in use, but those on which a heartbeat's sender is."""
        active = {index for indices in self._known.values() for index in indices}
        return active - self._private - set(seen_on)

    def _links_of_target(self, frame: Frame) -> set[int]:
        """Return the links behind which a message's target is; without a target all in use."""
        system = int(frame.fields.get("target_system", BROADCAST))
        component = int(frame.fields.get("target_component", BROADCAST))
        if (system, component) == (self._own, AUTOPILOT):
            return set()
        found: set[int] = set()
        for sender, indices in self._known.items():
            same_component = component in (BROADCAST, sender[1]) or system != self._own
            if system == BROADCAST or (sender[0] == system and same_component):
                allowed = set() if sender == (system, component) else self._private
                found.update(index for index in indices if index not in allowed)
        return found
