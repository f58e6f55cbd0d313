"""The provider of the service: receives every parcel event and keeps the log."""

from __future__ import annotations

import volery


class Provider:
    """Part of the surroundings: it stands for people and costs nothing."""

    def __init__(self):
        self.log = []

    def report(self, subject, state, detail):
        """*subject*, a parcel, an order or a vehicle, is in *state* now."""
        self.log.append((volery.now(), subject, state, detail))
        volery.log(f"{subject} {state}" + (f": {detail}" if detail else ""))
