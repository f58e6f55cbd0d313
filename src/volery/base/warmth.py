"""How warm a process is when it sends or receives a message, which its price depends on.

A graph knows it, a law of costs has figures for it, and neither imports the other.
"""

from __future__ import annotations

from typing import NamedTuple


class Warmth(NamedTuple):
    """What is left in caches, and whether threads are still awake.

    Attributes:
        follows: The process has sent or received a moment before: its threads are awake.
        often: It does so in short cycles: its caches are warm.
    """

    follows: bool = False
    often: bool = False


COLD = Warmth()
