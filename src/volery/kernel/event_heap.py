"""A heap of events: tuples of time, ticket and what happens. The least time is first, then the least ticket.

Tickets differ, so the order of a run does not depend on the heap. ``event_heap.c`` is this module in C, which
compares numbers of the machine instead of objects; ``make wheel`` compiles it, and where it stands beside
this file, Python imports it instead.
"""

from heapq import heappop, heappush, heapreplace
from typing import TypeVar

__all__ = ["EventHeap", "heappop", "heappush", "heapreplace"]

Event = TypeVar("Event")


class EventHeap(list[Event]):
    """Events, in the order of a heap."""
