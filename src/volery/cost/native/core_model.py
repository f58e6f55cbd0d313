"""A superscalar core with out-of-order execution, driven by what ran: when each piece of code is finished.

An instruction enters in order, ``width`` slots a cycle, while the window has room. It executes when its
operands are there and a pipe is free, and leaves in order. A store is remembered by the text of its address
and the versions of the registers in it: a load of the same place waits for it, and one of parts of several
stores until they have left. Branches are predicted by their history (``prediction``), computed jumps by their
last target with it; after a wrong prediction nothing enters until the branch is done and ``refill`` cycles
have passed. A call of a library takes its time of the front end, and its result takes twice that.

An access hits the first cache, or is served by the level that the trace says. Memory gives a line at a time:
one that was fetched ahead is there as soon as memory can give it, any other after its latency as well.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from volery.cost.native.branch_prediction import new_predictor, predict_branch, record_taken

Array = np.ndarray[Any, np.dtype[Any]]

REGISTERS = 64
READS, ADDRESSES, WRITES, BUMPS = 6, 4, 4, 2
SLOT_CYCLES = 4096
PLACES = 8192
CHUNK = 4
BLOCKED = 8.0

# columns of the table of instructions
SIZE, LOAD, LOADS, OPERATION, TIMES, STORE, PLACE, KIND, DISPLACEMENT = range(9)
FIRST_READ = 9
FIRST_ADDRESS = FIRST_READ + READS
FIRST_WRITE = FIRST_ADDRESS + ADDRESSES
FIRST_BUMP = FIRST_WRITE + WRITES
COLUMNS = FIRST_BUMP + BUMPS

PLAIN, CONDITIONAL, COMPUTED, LIBRARY, JUMP = range(5)

# columns of the table of operations
LATENCY, KIND_OF, GROUP = range(3)
# places in the vector of the core's own figures
WIDTH, WINDOW, REFILL, FORWARD = range(4)
# columns of the accesses that the first cache does not serve
STEP, ROW, LEVEL, AHEAD = range(4)
LINES_AHEAD = 4.0
"""So many lines before they are asked for are they fetched."""


@njit(cache=True)
def _issue(used: Array, capacity: Array, operation: Array, ready: float, times: float) -> float:
    """The cycle in which an operation starts: when its own kind and its group of pipes have room."""
    own = _first_free(used, capacity, int(operation[KIND_OF]), ready, times)
    if operation[GROUP] == operation[KIND_OF]:
        return own
    return _first_free(used, capacity, int(operation[GROUP]), own, times)


@njit(cache=True)
def _first_free(used: Array, capacity: Array, pipes: int, ready: float, need: float) -> float:
    """Take *need* of what the pipes can start from *ready* on; the first cycle in which there was some."""
    cycle = int(np.ceil(ready))
    started = -1
    last = cycle + SLOT_CYCLES - 2
    while need > 1e-9 and cycle < last:
        at = cycle % SLOT_CYCLES
        if used[pipes, at, 0] != cycle:
            used[pipes, at, 0] = cycle
            used[pipes, at, 1] = 0.0
        free = capacity[pipes] - used[pipes, at, 1]
        if free > 1e-9:
            taken = min(free, need)
            used[pipes, at, 1] += taken
            need -= taken
            if started < 0:
                started = cycle
        cycle += 1
    return float(max(started, int(np.ceil(ready))))


@njit(cache=True)
def _remembered(
    keys: Array, times: Array, key: np.int64, one: Array, number: int, done: float, leaves: float
) -> None:
    """Remember a store, in chunks of its memory: when its data are there, and when it has left the core."""
    for chunk in range(one[DISPLACEMENT] // CHUNK, (one[DISPLACEMENT] + one[SIZE] - 1) // CHUNK + 1):
        mixed = key * 31 + chunk * 2654435761
        at = (mixed >> 9) % PLACES
        keys[at, 0] = mixed
        keys[at, 1] = number
        times[at, 0] = done
        times[at, 1] = leaves


@njit(cache=True)
def _forwarded(keys: Array, times: Array, key: np.int64, one: Array, start: float, forward: float) -> float:
    """When a load has what a store under way is to leave there; parts of several stores must leave first."""
    ready, source, whole = 0.0, -1, True
    for chunk in range(one[DISPLACEMENT] // CHUNK, (one[DISPLACEMENT] + one[SIZE] - 1) // CHUNK + 1):
        mixed = key * 31 + chunk * 2654435761
        at = (mixed >> 9) % PLACES
        if keys[at, 0] != mixed or times[at, 1] < start:
            whole = whole and source == -1
            source = -2 if source == -1 else source
            continue
        if source not in (-1, keys[at, 1]):
            whole = False
        source = keys[at, 1]
        ready = max(ready, times[at, 0] + forward)
        if not whole:
            ready = max(ready, times[at, 1] + forward + BLOCKED)
    return ready


@njit(cache=True)
def _loaded(used: Array, capacity: Array, operation: Array, at: float, times: int) -> float:
    """When the last of so many loads has what the first cache serves."""
    started = at
    for _ in range(times):
        started = _issue(used, capacity, operation, at, 1.0)
    return float(started + operation[LATENCY])


@njit(cache=True)
def _there(registers: Array, ready: Array, start: float) -> float:
    """When the last of these registers has its value."""
    at = start
    for register in registers:
        if register >= 0:
            at = max(at, ready[register])
    return at


@njit(cache=True)
def _place(one: Array, version: Array) -> np.int64:
    """The name of a place in memory: the text of its address and the versions of the registers in it."""
    key = np.int64(one[PLACE]) * 1000003
    for register in one[FIRST_ADDRESS : FIRST_ADDRESS + ADDRESSES]:
        if register >= 0:
            key = (key ^ version[register]) * 16777619 + register
    return key


@njit(cache=True)
def _written(registers: Array, ready: Array, version: Array, done: float, changes: int) -> int:
    """These registers have a new value at *done*; returns how many changes there have been."""
    for register in registers:
        if register >= 0:
            ready[register] = done
            changes += 1
            version[register] = changes
    return changes


@njit(cache=True)
def _fetched(
    late: Array, first: int, last: int, levels: Array, line: float, at: float, free: float
) -> tuple[float, float]:
    """When the last of a load's late accesses arrives, and from when on memory is free again."""
    arrives = at
    for i in range(first, last):
        level, ahead = late[i, LEVEL], late[i, AHEAD]
        if level == len(levels) - 1 and line > 0.0:
            begins = max(free, at - LINES_AHEAD * line if ahead else at)
            free = begins + line
            arrives = max(arrives, free if ahead else begins + levels[level])
        elif not ahead:
            arrives = max(arrives, at + levels[level])
    return arrives, free


@njit(cache=True)
def _sent(late: Array, first: int, last: int, levels: Array, line: float, at: float, free: float) -> float:
    """From when on memory is free again after a store's late accesses, for which nobody waits."""
    for i in range(first, last):
        if late[i, LEVEL] == len(levels) - 1 and line > 0.0:
            free = max(free, at) + line
    return free


@njit(cache=True)
def _of_this(late: Array, first: int, step: int, row: int) -> int:
    """Where the late accesses end that belong to this instruction."""
    last = first
    while last < len(late) and late[last, STEP] == step and late[last, ROW] == row:
        last += 1
    return last


@njit(cache=True)
def _foreseen(
    predictor: Any, lengths: Array, targets: Array, kind: int, row: int, taken: bool, target: int
) -> bool:
    """Whether the core enters the right piece after a branch; it learns from what was right."""
    right = True
    if kind == CONDITIONAL:
        right = predict_branch(predictor, lengths, row, taken)
    elif kind == COMPUTED:
        seen = (row ^ predictor[3][len(lengths) // 2, 0]) % PLACES
        right = targets[seen] == target
        targets[seen] = target
    if kind != CONDITIONAL or taken:
        record_taken(predictor, lengths, row, target)
    return right


@njit(cache=True)
def run(
    pieces: Array, taken: Array, first: Array, table: Array, operations: Array, capacity: Array, core: Array,
    slots: Array, library: Array, lengths: Array, late: Array, levels: Array, line: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Cycles from the end of the piece before to the end of each piece, and how many of them nothing entered
    because the branch before had been mispredicted.

    *first* has each piece's first row in *table*, and one more entry; *slots* an instruction's slots;
    *library* the cycles of a call of a library, by the row. *late* has the accesses that the first cache does
    not serve, in order; *levels* the latency of each level; *line* the cycles in which memory gives a line, 0
    where it is a level like the others.
    """
    count = len(pieces)
    cost = np.zeros(count)
    stalled = np.zeros(count)
    ready = np.zeros(REGISTERS)
    version = np.zeros(REGISTERS, dtype=np.int64)
    used = np.full((len(capacity), SLOT_CYCLES, 2), -1.0)
    window = int(core[WINDOW])
    leaves = np.zeros(window)
    stored_key = np.zeros((PLACES, 2), dtype=np.int64)
    stored = np.zeros((PLACES, 2))
    predictor = new_predictor(len(lengths))
    targets = np.full(PLACES, -1, dtype=np.int64)
    enters, resumes, retired, clock, number, changes = 0.0, 0.0, 0.0, 0.0, 0, 0
    next_late, free = 0, 0.0
    for step in range(count):
        piece = pieces[step]
        stalled[step] = max(0.0, resumes - clock)
        enters = max(enters, resumes)
        for row in range(first[piece], first[piece + 1]):
            one = table[row]
            enters = max(enters + slots[row] / core[WIDTH], leaves[number % window])
            if one[KIND] == LIBRARY:
                done = max(enters, ready[0], ready[1]) + 2.0 * library[row]
                enters += library[row]
                ready[0] = ready[1] = done
            else:
                at = _there(one[FIRST_ADDRESS:FIRST_WRITE], ready, enters)
                done = _there(one[FIRST_READ:FIRST_ADDRESS], ready, enters)
                place = _place(one, version) if one[PLACE] != 0 else np.int64(0)
                last_late = _of_this(late, next_late, step, row)
                if one[LOAD] >= 0:
                    loaded = _loaded(used, capacity, operations[one[LOAD]], at, one[LOADS])
                    arrives, free = _fetched(late, next_late, last_late, levels, line, at, free)
                    done = max(done, loaded, arrives)
                    if one[PLACE] != 0:
                        done = max(done, _forwarded(stored_key, stored, place, one, at, core[FORWARD]))
                else:
                    free = _sent(late, next_late, last_late, levels, line, at, free)
                next_late = last_late
                if one[OPERATION] >= 0:
                    operation = operations[one[OPERATION]]
                    done = _issue(used, capacity, operation, done, float(one[TIMES])) + operation[LATENCY]
                if one[STORE] >= 0:
                    done = max(done, _issue(used, capacity, operations[one[STORE]], at, 1.0))
                    if one[PLACE] != 0:
                        _remembered(stored_key, stored, place, one, number, done, max(done, retired))
                changes = _written(one[FIRST_WRITE:FIRST_BUMP], ready, version, done, changes)
                changes = _written(one[FIRST_BUMP:COLUMNS], ready, version, at + 1.0, changes)
            retired = max(retired, done)
            leaves[number % window] = retired
            number += 1
            if one[KIND] == PLAIN or one[KIND] == LIBRARY or step + 1 == count:
                continue
            target = pieces[step + 1]
            if not _foreseen(predictor, lengths, targets, one[KIND], row, taken[step] == 1, target):
                resumes = done + core[REFILL]
        finished = max(retired, enters)
        cost[step] = finished - clock
        clock = finished
    return cost, stalled
