"""How often Python looks for cyclic garbage: a command and a run make little of it."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

COLLECT_EVERY = 20_000
"""Objects between two collections: most that a command or a run makes are modules and classes, which stay,
or are freed by their reference counts."""


@contextmanager
def seldom_collected() -> Iterator[None]:
    """Collect garbage every ``COLLECT_EVERY`` objects at most; also a decorator.

    A caller who collects more seldom, or not at all, is left alone.
    """
    before = gc.get_threshold()
    if 0 < before[0] < COLLECT_EVERY:
        gc.set_threshold(COLLECT_EVERY, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
