"""Named random streams. The only owner of ``random``: every draw in a run comes from a stream named here."""

from __future__ import annotations

import hashlib
import random


def _digest(seed: int, name: str) -> bytes:
    return hashlib.sha256(f"{seed}/{name}".encode()).digest()


def stream(seed: int, name: str) -> random.Random:
    """A generator that depends on the run's *seed* and its own *name* only."""
    return random.Random(_digest(seed, name))


def key(seed: int, name: str) -> int:
    """A 64-bit key for counter-based noise in compiled code: draw number *k* is a function of (key, k)."""
    return int.from_bytes(_digest(seed, name)[:8], "big")
