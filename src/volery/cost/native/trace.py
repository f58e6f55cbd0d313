"""What a traced program says of itself: the blocks that it entered, the values that its switches used, and
the accesses to memory that the first cache did not serve.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

_SWITCHED, _ACCESSED = 1 << 31, 1 << 30


class Access(NamedTuple):
    """An access to memory that the first cache did not serve.

    ``number`` of it in its block; ``level`` of what served it: 1 for the second cache; ``ahead``: it was
    fetched before it was asked for.
    """

    number: int
    store: bool
    level: int
    ahead: bool


@dataclass(frozen=True)
class Trace:
    """``blocks`` by number, in the order in which they were entered; ``switches``: the value that a switch
    used before the block of that place was entered; ``edges``: the block that was left out there;
    ``accesses`` of the block of that place.
    """

    blocks: list[int]
    switches: dict[int, int] = field(default_factory=dict)
    edges: dict[int, int] = field(default_factory=dict)
    accesses: dict[int, list[Access]] = field(default_factory=dict)

    def then(self, other: Trace) -> Trace:
        """Both, one after the other."""
        first = len(self.blocks)
        return Trace(
            self.blocks + other.blocks,
            self.switches | {first + place: value for place, value in other.switches.items()},
            accesses=self.accesses | {first + place: told for place, told in other.accesses.items()},
        )

    def until(self, length: int) -> Trace:
        """The first *length* blocks."""
        return replace(self, blocks=self.blocks[:length])

    def only(self, wanted: Container[int]) -> Trace:
        """Without the other blocks; of several left out in one place the first is an edge. Their accesses
        count as made in the block before.
        """
        kept: list[int] = []
        switches: dict[int, int] = {}
        edges: dict[int, int] = {}
        accesses: dict[int, list[Access]] = {}
        for place, block in enumerate(self.blocks):
            if place in self.switches:
                switches.setdefault(len(kept), self.switches[place])
            if block in wanted:
                kept.append(block)
            else:
                edges.setdefault(len(kept), block)
            if place in self.accesses and kept:
                accesses.setdefault(len(kept) - 1, []).extend(self.accesses[place])
        return Trace(kept, switches, edges, accesses)


def read_trace(file: Path) -> Trace:
    """A trace that the runtime has written."""
    return trace_of(np.fromfile(file, dtype=np.uint32))


def _access(word: int) -> Access:
    """As ``caches.c`` puts it into a word."""
    return Access(word >> 5, bool(word >> 4 & 1), word & 7, bool(word & 8))


def trace_of(words: np.ndarray[Any, np.dtype[np.uint32]]) -> Trace:
    """A trace as the runtime writes it; what stands before its first block is left out."""
    blocks: list[int] = []
    switches: dict[int, int] = {}
    accesses: dict[int, list[Access]] = {}
    for word in words.tolist():
        if word < _ACCESSED:
            blocks.append(word)
        elif word >= _SWITCHED:  # 31 bits with their sign
            switches[len(blocks)] = ((word & (_SWITCHED - 1)) ^ (1 << 30)) - (1 << 30)
        elif blocks:
            accesses.setdefault(len(blocks) - 1, []).append(_access(word - _ACCESSED))
    return Trace(blocks, switches, accesses=accesses)
