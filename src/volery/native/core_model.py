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

from volery.native.prediction import foresees, fresh, remember

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
    predictor = fresh(len(lengths))
    targets = np.full(PLACES, -1, dtype=np.int64)
    enters, resumes, retired, clock, number, changes = 0.0, 0.0, 0.0, 0.0, 0, 0
    next_late, memory_free, memory = 0, 0.0, len(levels) - 1
    for step in range(count):
        piece = pieces[step]
        stalled[step] = max(0.0, resumes - clock)
        enters = max(enters, resumes)
        for row in range(first[piece], first[piece + 1]):
            one = table[row]
            enters = max(enters + slots[row] / core[WIDTH], leaves[number % window])
            start = enters
            if one[KIND] == LIBRARY:
                enters = start + library[row]
                done = max(start, ready[0], ready[1]) + 2.0 * library[row]
                ready[0] = ready[1] = done
                retired = max(retired, done)
                leaves[number % window] = retired
                number += 1
                continue
            at = start
            key = np.int64(one[PLACE]) * 1000003
            for i in range(ADDRESSES):
                register = one[FIRST_ADDRESS + i]
                if register >= 0:
                    at = max(at, ready[register])
                    key = (key ^ version[register]) * 16777619 + register
            operand = start
            for i in range(READS):
                register = one[FIRST_READ + i]
                if register >= 0:
                    operand = max(operand, ready[register])
            if one[LOAD] >= 0:
                loaded = at
                for _ in range(one[LOADS]):
                    loaded = _issue(used, capacity, operations[one[LOAD]], at, 1.0)
                loaded += operations[one[LOAD], LATENCY]
                arrives = at
                while next_late < len(late) and late[next_late, STEP] == step and late[next_late, ROW] == row:
                    level, ahead = late[next_late, LEVEL], late[next_late, AHEAD]
                    next_late += 1
                    if level == memory and line > 0.0:
                        begins = max(memory_free, at - LINES_AHEAD * line if ahead else at)
                        memory_free = begins + line
                        arrives = max(arrives, memory_free if ahead else begins + levels[level])
                    elif not ahead:
                        arrives = max(arrives, at + levels[level])
                loaded = max(loaded, arrives)
                if one[PLACE] != 0:
                    loaded = max(loaded, _forwarded(stored_key, stored, key, one, at, core[FORWARD]))
                operand = max(operand, loaded)
            done = operand
            if one[OPERATION] >= 0:
                operation = operations[one[OPERATION]]
                done = _issue(used, capacity, operation, operand, float(one[TIMES]))
                done += operation[LATENCY]
            while next_late < len(late) and late[next_late, STEP] == step and late[next_late, ROW] == row:
                if late[next_late, LEVEL] == memory and line > 0.0:  # nobody waits for a store
                    memory_free = max(memory_free, at) + line
                next_late += 1
            if one[STORE] >= 0:
                sent = _issue(used, capacity, operations[one[STORE]], at, 1.0)
                done = max(done, sent)
                if one[PLACE] != 0:
                    _remembered(stored_key, stored, key, one, number, done, max(done, retired))
            for i in range(WRITES):
                register = one[FIRST_WRITE + i]
                if register >= 0:
                    ready[register] = done
                    changes += 1
                    version[register] = changes
            for i in range(BUMPS):
                register = one[FIRST_BUMP + i]
                if register >= 0:
                    ready[register] = at + 1.0
                    changes += 1
                    version[register] = changes
            retired = max(retired, done)
            leaves[number % window] = retired
            number += 1
            if one[KIND] == PLAIN or step + 1 == count:
                continue
            target = pieces[step + 1]
            right = True
            if one[KIND] == CONDITIONAL:
                right = foresees(predictor, lengths, row, taken[step] == 1)
            elif one[KIND] == COMPUTED:
                seen = (row ^ predictor[3][len(lengths) // 2, 0]) % PLACES
                right = targets[seen] == target
                targets[seen] = target
            if not right:
                resumes = done + core[REFILL]
            if one[KIND] != CONDITIONAL or taken[step] == 1:
                remember(predictor, lengths, row, target)
        finished = max(retired, enters)
        cost[step] = finished - clock
        clock = finished
    return cost, stalled
