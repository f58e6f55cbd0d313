"""Named random streams. Every random number of a run comes from a stream of this module."""

from __future__ import annotations

import hashlib
import random


def _digest(seed: int, name: str) -> bytes:
    return hashlib.sha256(f"{seed}/{name}".encode()).digest()


def stream(seed: int, name: str) -> random.Random:
    """Return a generator that depends only on the *seed* of the run and its own *name*."""
    return random.Random(_digest(seed, name))


def key(seed: int, name: str) -> int:
    """Return a 64-bit key for counter-based noise in compiled code: draw *k* is a function of (key, k)."""
    return int.from_bytes(_digest(seed, name)[:8], "big")
