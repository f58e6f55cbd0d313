"""Prediction of conditional branches: a simplified TAGE (Seznec and Michaud, JILP 8, 2006).

The predictor has a table of counters by branch, and tagged tables by branch and by ever longer histories of
taken branches. The longest history with an entry for the branch decides. A misprediction allocates an entry
with a longer history. The predictor starts empty: the training of a real one by other code is not modelled.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

Array = np.ndarray[Any, np.dtype[Any]]

BITS = 12
SIZE = 1 << BITS
TAG_BITS = 11
FIRST_HISTORY = 4
RECORD = 1024

# columns of an entry of a tagged table
TAG, COUNTER, USEFUL = range(3)


def history_lengths(tables: int, longest: int) -> Array:
    """Return the history lengths of the tagged tables, bits: geometric, up to ``longest`` branches."""
    steps = np.linspace(0.0, 1.0, tables)
    return np.round(FIRST_HISTORY * (2 * longest / FIRST_HISTORY) ** steps).astype(np.int64)


@njit(cache=True)
def new_predictor(tables: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return an empty predictor: base counters, tagged entries, history, folded histories, position."""
    base = np.zeros(SIZE, dtype=np.int64)
    tagged = np.zeros((tables, SIZE, 3), dtype=np.int64)
    tagged[:, :, TAG] = -1
    return (
        base,
        tagged,
        np.zeros(RECORD, dtype=np.int64),
        np.zeros((tables, 2), dtype=np.int64),
        np.zeros(3, dtype=np.int64),
    )


@njit(cache=True)
def _fold(folded: int, new: int, old: int, length: int, bits: int) -> int:
    folded = (folded << 1) | new
    folded ^= old << (length % bits)
    folded ^= folded >> bits
    return folded & ((1 << bits) - 1)


@njit(cache=True)
def record_taken(
    state: tuple[Array, Array, Array, Array, Array], lengths: Array, place: int, target: int
) -> None:
    """Append a taken branch to the history: two bits of its address and its target."""
    _, _, record, folds, position = state
    mark = place * 3 ^ target * 7 ^ (place >> 2)
    for bit in (mark & 1, (mark >> 1) & 1):
        at = position[0]
        for table in range(len(lengths)):
            old = record[(at - lengths[table]) % RECORD]
            folds[table, 0] = _fold(folds[table, 0], bit, old, lengths[table], BITS)
            folds[table, 1] = _fold(folds[table, 1], bit, old, lengths[table], TAG_BITS)
        record[at % RECORD] = bit
        position[0] = at + 1


@njit(cache=True)
def predict_branch(
    state: tuple[Array, Array, Array, Array, Array], lengths: Array, place: int, taken: bool
) -> bool:
    """Return whether the branch at ``place`` is predicted correctly; train the predictor."""
    base, tagged, _, folds, position = state
    tables = len(lengths)
    mixed = place ^ (place >> BITS)
    provider, alternate = -1, -1
    for table in range(tables - 1, -1, -1):
        entry = tagged[table, (mixed ^ folds[table, 0] ^ (table * 7)) % SIZE]
        if entry[TAG] == (place * 5 ^ folds[table, 1]) % (1 << TAG_BITS):
            if provider < 0:
                provider = table
            else:
                alternate = table
                break
    base_at = place % SIZE
    alternative = base[base_at] >= 0
    if alternate >= 0:
        alternative = tagged[alternate, (mixed ^ folds[alternate, 0] ^ (alternate * 7)) % SIZE, COUNTER] >= 0
    predicted = alternative
    if provider >= 0:
        entry = tagged[provider, (mixed ^ folds[provider, 0] ^ (provider * 7)) % SIZE]
        own = entry[COUNTER] >= 0
        weak = entry[USEFUL] == 0 and (entry[COUNTER] == 0 or entry[COUNTER] == -1)
        predicted = alternative if weak and position[2] >= 0 else own
        if weak and own != alternative:
            position[2] = min(7, position[2] + 1) if alternative == taken else max(-8, position[2] - 1)
        if own != alternative:
            entry[USEFUL] = min(3, entry[USEFUL] + 1) if own == taken else max(0, entry[USEFUL] - 1)
        entry[COUNTER] = min(3, entry[COUNTER] + 1) if taken else max(-4, entry[COUNTER] - 1)
    if provider < 0 or alternate < 0:
        base[base_at] = min(1, base[base_at] + 1) if taken else max(-2, base[base_at] - 1)
    if predicted != taken and provider < tables - 1:
        allocated = False
        position[1] += 1
        start = provider + 1
        if position[1] % 2 == 0 and start < tables - 1:
            start += 1
        for table in range(start, tables):
            entry = tagged[table, (mixed ^ folds[table, 0] ^ (table * 7)) % SIZE]
            if entry[USEFUL] == 0:
                entry[TAG] = (place * 5 ^ folds[table, 1]) % (1 << TAG_BITS)
                entry[COUNTER] = 0 if taken else -1
                allocated = True
                break
        if not allocated:
            for table in range(start, tables):
                tagged[table, (mixed ^ folds[table, 0] ^ (table * 7)) % SIZE, USEFUL] -= 1
    return bool(predicted == taken)
