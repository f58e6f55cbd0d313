"""What a traced program says of itself: the blocks that it entered, and the values that its switches used."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field
from typing import Any

import numpy as np

_SWITCHED = 1 << 31


@dataclass(frozen=True)
class Trace:
    """``blocks`` by number, in the order in which they were entered; ``switches``: the value that a switch
    used before the block of that place was entered; ``edges``: the block that was left out there.
    """

    blocks: list[int]
    switches: dict[int, int] = field(default_factory=dict)
    edges: dict[int, int] = field(default_factory=dict)

    def until(self, length: int) -> Trace:
        """The first *length* blocks."""
        return Trace(self.blocks[:length], self.switches)

    def only(self, wanted: Container[int]) -> Trace:
        """Without the other blocks; of several left out in one place the first is an edge."""
        kept: list[int] = []
        switches: dict[int, int] = {}
        edges: dict[int, int] = {}
        for place, block in enumerate(self.blocks):
            if place in self.switches:
                switches.setdefault(len(kept), self.switches[place])
            if block in wanted:
                kept.append(block)
            else:
                edges.setdefault(len(kept), block)
        return Trace(kept, switches, edges)


def trace_of(words: np.ndarray[Any, np.dtype[np.uint32]]) -> Trace:
    """A trace as the runtime writes it; what stands before its first block is left out."""
    blocks: list[int] = []
    switches: dict[int, int] = {}
    for word in words.tolist():
        if word < _SWITCHED:
            blocks.append(word)
        else:  # 31 bits with their sign
            switches[len(blocks)] = ((word & (_SWITCHED - 1)) ^ (1 << 30)) - (1 << 30)
    return Trace(blocks, switches)
