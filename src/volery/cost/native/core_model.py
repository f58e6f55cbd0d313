"""Model of a superscalar core with out-of-order execution, driven by the machine blocks that ran.

Instructions enter the reorder buffer in order, ``width`` slots a cycle. An operation waits in the issue queue
of its pipes until its operands are available and a pipe is free, the oldest first; nothing enters while the
queue that the next instruction needs is full. Instructions retire in order. A store is identified by its
address in the trace, or, where that is not known, by the text of the address and the versions of the
registers in it: a load of the same address is forwarded from it, and a load of parts of several stores waits
until they have retired. After a taken branch nothing else enters in that cycle, after a
computed jump to another target than its usual one not for ``computed`` cycles. After a
misprediction nothing enters until the branch is done and ``refill`` cycles have passed. A library call
occupies the front end for its cycles and the reorder buffer by the instructions of that time, and its result
is available after its latency. An access hits the first cache, or is served by the level in the trace. Memory
delivers one line at a time: a prefetched line is available as soon as memory can deliver it, any other after
the latency as well.

Branches are predicted by a simplified TAGE (Seznec and Michaud, JILP 8, 2006): a table of counters by branch,
and tagged tables by branch and by ever longer histories of taken branches. The longest history with an entry
for the branch decides. A misprediction allocates an entry with a longer history. In the beginning the table
by branch holds the direction that each branch takes more often, as after earlier activations; the tagged
tables are empty, as if other code had evicted their entries. Computed jumps are predicted in the same way by
tables of targets (ITTAGE; Seznec, JWAC-2, 2011): without an entry for a long history that for a shorter one
decides, and in the end the usual target of the jump.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from volery.base.numeric_code import NumericCode, numeric

BITS = 12
TABLE_SIZE = 1 << BITS
TAG_BITS = 11
FIRST_HISTORY = 4
FOOTPRINT = 16
"""Bits by which a taken branch changes the history (Yavarzadeh et al., Half&Half, IEEE S&P 2023)."""
RECORD = 1024

TARGETS = 512
"""Entries of a table of targets."""

# columns of an entry of a tagged table, and of a table of targets
TAG, COUNTER, USEFUL = range(3)
TARGET, CONFIDENCE = 1, 2


def history_lengths(tables: int, longest: int) -> Array:
    """Return the history lengths of the tagged tables, bits: geometric, up to ``longest`` branches."""
    steps = np.linspace(0.0, 1.0, tables)
    return np.round(FIRST_HISTORY * (2 * longest / FIRST_HISTORY) ** steps).astype(np.int64)


def new_predictor(tables: int, base: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return a predictor without tagged entries: counters, entries, history, folded histories, position."""
    tagged = np.zeros((tables, TABLE_SIZE, 3), dtype=np.int64)
    tagged[:, :, TAG] = -1
    return (
        base,
        tagged,
        np.zeros(RECORD, dtype=np.int64),
        np.zeros((tables, 2), dtype=np.int64),
        np.zeros(3, dtype=np.int64),
    )


@numeric
def _fold(folded: int, old: int, length: int, bits: int) -> int:
    """Return a folded history one bit later: a zero enters, the oldest bit leaves."""
    folded = (folded << 1) ^ (old << (length % bits))
    folded ^= folded >> bits
    return folded & ((1 << bits) - 1)


@numeric
def record_taken(
    state: tuple[Array, Array, Array, Array, Array], lengths: Array, place: int, target: int
) -> None:
    """Append a taken branch to the history: it moves by two bits, and all bits of the footprint are added."""
    _, _, record, folds, position = state
    mixed = (place * 40503 + target * 30345) & 0xFFFFFFFF
    footprint = (mixed ^ (mixed >> FOOTPRINT)) & ((1 << FOOTPRINT) - 1)
    for _ in range(2):
        at = position[0]
        for table in range(len(lengths)):
            old = record[(at - lengths[table]) % RECORD]
            folds[table, 0] = _fold(folds[table, 0], old, lengths[table], BITS)
            folds[table, 1] = _fold(folds[table, 1], old, lengths[table], TAG_BITS)
        record[at % RECORD] = 0
        position[0] = at + 1
    for age in range(FOOTPRINT):
        record[(position[0] - 1 - age) % RECORD] ^= (footprint >> age) & 1
    for table in range(len(lengths)):
        within = footprint & ((1 << min(FOOTPRINT, lengths[table])) - 1)
        folds[table, 0] ^= (within ^ (within >> BITS)) & ((1 << BITS) - 1)
        folds[table, 1] ^= (within ^ (within >> TAG_BITS)) & ((1 << TAG_BITS) - 1)


@numeric
def predict_branch(
    state: tuple[Array, Array, Array, Array, Array], lengths: Array, place: int, taken: bool
) -> bool:
    """Return whether the branch at ``place`` is predicted correctly; train the predictor."""
    base, tagged, _, folds, position = state
    tables = len(lengths)
    mixed = place ^ (place >> BITS)
    provider, alternate = -1, -1
    for table in range(tables - 1, -1, -1):
        entry = tagged[table, (mixed ^ folds[table, 0] ^ (table * 7)) % TABLE_SIZE]
        if entry[TAG] == (place * 5 ^ folds[table, 1]) % (1 << TAG_BITS):
            if provider < 0:
                provider = table
            else:
                alternate = table
                break
    base_at = place % TABLE_SIZE
    alternative = base[base_at] >= 0
    if alternate >= 0:
        alternative = (
            tagged[alternate, (mixed ^ folds[alternate, 0] ^ (alternate * 7)) % TABLE_SIZE, COUNTER] >= 0
        )
    predicted = alternative
    if provider >= 0:
        entry = tagged[provider, (mixed ^ folds[provider, 0] ^ (provider * 7)) % TABLE_SIZE]
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
            entry = tagged[table, (mixed ^ folds[table, 0] ^ (table * 7)) % TABLE_SIZE]
            if entry[USEFUL] == 0:
                entry[TAG] = (place * 5 ^ folds[table, 1]) % (1 << TAG_BITS)
                entry[COUNTER] = 0 if taken else -1
                allocated = True
                break
        if not allocated:
            for table in range(start, tables):
                tagged[table, (mixed ^ folds[table, 0] ^ (table * 7)) % TABLE_SIZE, USEFUL] -= 1
    return bool(predicted == taken)


@numeric
def _entry(entries: Array, folds: Array, place: int, table: int) -> Any:
    """Return the entry of a computed jump for a history; table -1 is by the jump alone."""
    mixed = place if table < 0 else place ^ folds[table, 0] ^ (table * 7)
    return entries[table + 1, (mixed ^ mixed // TARGETS) % TARGETS]


@numeric
def _longest(entries: Array, folds: Array, place: int, below: int) -> int:
    """Return the longest history below a number that has an entry for a computed jump, or -1."""
    for table in range(below - 1, -1, -1):
        if _entry(entries, folds, place, table)[TAG] == (place * 5 ^ folds[table, 1]) % (1 << TAG_BITS):
            return table
    return -1


@numeric
def predict_target(entries: Array, folds: Array, position: Array, place: int, target: int) -> bool:
    """Return whether the target of the computed jump at ``place`` is predicted; train the tables.

    The first table is by jump alone, the others are by the histories. An entry that was not right yet does
    not decide.
    """
    tables = len(folds)
    longest = _longest(entries, folds, place, tables)
    decides = longest
    while decides >= 0 and _entry(entries, folds, place, decides)[CONFIDENCE] == 0:
        decides = _longest(entries, folds, place, decides)
    right = _entry(entries, folds, place, decides)[TARGET] == target
    for table in (decides, longest):
        entry = _entry(entries, folds, place, table)
        if entry[TARGET] == target:
            entry[CONFIDENCE] = min(3, entry[CONFIDENCE] + 1)
        elif entry[CONFIDENCE] > 0:
            entry[CONFIDENCE] -= 1
        else:
            entry[TARGET] = target
        if decides == longest:
            break
    if not right:
        position[1] += 1
        start = longest + 1
        if position[1] % 2 == 0 and start < tables - 1:  # or two jumps would evict each other for ever
            start += 1
        for table in range(start, tables):
            entry = _entry(entries, folds, place, table)
            if entry[CONFIDENCE] == 0:
                entry[TAG] = (place * 5 ^ folds[table, 1]) % (1 << TAG_BITS)
                entry[TARGET] = target
                break
            entry[CONFIDENCE] -= 1
    return bool(right)


Array = np.ndarray[Any, np.dtype[Any]]

REGISTERS = 64
READS, ADDRESSES, WRITES, BUMPS = 6, 4, 4, 2
SLOT_CYCLES = 4096
PLACES = 8192
CHUNK = 4
BLOCKED = 15.0
"""Cycles that a load of parts of several stores takes more than one forwarded, on an Intel Xeon with AMX."""

# columns of the instruction table
SIZE, LOAD, LOADS, OPERATION, TIMES, STORE, PLACE, KIND, DISPLACEMENT = range(9)
FIRST_READ = 9
FIRST_ADDRESS = FIRST_READ + READS
FIRST_WRITE = FIRST_ADDRESS + ADDRESSES
FIRST_BUMP = FIRST_WRITE + WRITES
COLUMNS = FIRST_BUMP + BUMPS

PLAIN, CONDITIONAL, COMPUTED, LIBRARY, JUMP = range(5)

# columns of the operation table
LATENCY, KIND_OF, GROUP, QUEUE, OCCUPIES = range(5)
# entries of the vector of the core's figures
WIDTH, WINDOW, REFILL, FORWARD, JUMPS = range(5)
# columns of the table of cache misses
STEP, ROW, LEVEL, AHEAD = range(4)
IN_TRACE = np.int64(-1)
"""Identity of addresses of the trace; the displacement is the address."""
IN_A_CALL = 0.5
"""Instructions of a library call by cycle and by width: they occupy the reorder buffer until it retires."""
LINES_AHEAD = 4.0
"""Distance of the prefetcher, lines."""


@numeric
def _issue(used: Array, capacity: Array, operation: Array, ready: float, times: float) -> float:
    """Return the cycle in which an operation starts: its class and its group of pipes have capacity then."""
    own = _first_free(used, capacity, int(operation[KIND_OF]), ready, times)
    if operation[GROUP] == operation[KIND_OF]:
        return own
    return _first_free(used, capacity, int(operation[GROUP]), own, times * operation[OCCUPIES])


@numeric
def _first_free(used: Array, capacity: Array, pipes: int, ready: float, need: float) -> float:
    """Reserve ``need`` of the pipes' capacity from ``ready`` on; return the first cycle with some."""
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


@numeric
def _queued_until(queues: Array, operations: Array, one: Array) -> float:
    """Return when each issue queue that an instruction needs has a free entry."""
    at = 0.0
    for column in (LOAD, OPERATION, STORE):
        if one[column] >= 0 and operations[one[column], QUEUE] >= 0.0:
            at = max(at, queues[int(operations[one[column], QUEUE]), 0])
    return float(at)


@numeric
def _occupy(queues: Array, operation: Array, until: float) -> None:
    """Occupy the first free entry of an operation's issue queue ``until`` it executes.

    A queue is a heap of the times at which its entries become free; entries that it lacks never do.
    """
    if operation[QUEUE] < 0.0:
        return
    heap = queues[int(operation[QUEUE])]
    at, below = 0, 1
    while below < len(heap):
        if below + 1 < len(heap) and heap[below + 1] < heap[below]:
            below += 1
        if heap[below] >= until:
            break
        heap[at] = heap[below]
        at, below = below, 2 * below + 1
    heap[at] = until


@numeric
def _record_store(
    keys: Array, times: Array, key: np.int64, where: int, size: int, number: int, done: float, leaves: float
) -> None:
    """Record a store by chunks of memory: when its data are available, and when it retires."""
    for chunk in range(where // CHUNK, (where + size - 1) // CHUNK + 1):
        mixed = key * 31 + chunk * 2654435761
        at = (mixed >> 9) % PLACES
        keys[at, 0] = mixed
        keys[at, 1] = number
        times[at, 0] = done
        times[at, 1] = leaves


@numeric
def _forward(
    keys: Array, times: Array, key: np.int64, where: int, size: int, start: float, forward: float
) -> float:
    """Return when a load has the data of pending stores; parts of several stores must retire first."""
    ready, source, whole = 0.0, -1, True
    for chunk in range(where // CHUNK, (where + size - 1) // CHUNK + 1):
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


@numeric
def _load(used: Array, capacity: Array, operation: Array, at: float, times: int) -> float:
    """Return when the last of ``times`` loads starts."""
    started = at
    for _ in range(times):
        started = _issue(used, capacity, operation, at, 1.0)
    return float(started)


@numeric
def _available(registers: Array, ready: Array, start: float) -> float:
    """Return when the last of these registers has its value."""
    at = start
    for register in registers:
        if register >= 0:
            at = max(at, ready[register])
    return at


@numeric
def _address(one: Array, version: Array) -> np.int64:
    """Return the identity of an address: its text and the versions of the registers in it."""
    key = np.int64(one[PLACE]) * 1000003
    for register in one[FIRST_ADDRESS : FIRST_ADDRESS + ADDRESSES]:
        if register >= 0:
            key = (key ^ version[register]) * 16777619 + register
    return key


@numeric
def _write_registers(registers: Array, ready: Array, version: Array, done: float, changes: int) -> int:
    """Give registers a new value at ``done``; return the number of changes so far."""
    for register in registers:
        if register >= 0:
            ready[register] = done
            changes += 1
            version[register] = changes
    return changes


@numeric
def _fetch_lines(
    misses: Array, first: int, last: int, levels: Array, line: float, at: float, free: float
) -> tuple[float, float]:
    """Return when the last of a load's missing lines arrives, and when memory is free again."""
    arrives = at
    for i in range(first, last):
        level, ahead = misses[i, LEVEL], misses[i, AHEAD]
        if level == len(levels) - 1 and line > 0.0:
            begins = max(free, at - LINES_AHEAD * line if ahead else at)
            free = begins + line
            arrives = max(arrives, free if ahead else begins + levels[level])
        elif not ahead:
            arrives = max(arrives, at + levels[level])
    return arrives, free


@numeric
def _send_lines(
    misses: Array, first: int, last: int, levels: Array, line: float, at: float, free: float
) -> float:
    """Return when memory is free again after a store's misses, which delay no instruction."""
    for i in range(first, last):
        if misses[i, LEVEL] == len(levels) - 1 and line > 0.0:
            free = max(free, at) + line
    return free


@numeric
def _end_of_misses(misses: Array, first: int, step: int, row: int) -> int:
    """Return the end of the misses that belong to an instruction."""
    last = first
    while last < len(misses) and misses[last, STEP] == step and misses[last, ROW] == row:
        last += 1
    return last


@numeric
def _predict(
    predictor: Any, histories: Array, targets: Array, kind: int, row: int, taken: bool, target: int
) -> bool:
    """Return whether the core predicts the next machine block; train the predictor."""
    right = True
    if kind == CONDITIONAL:
        right = predict_branch(predictor, histories, row, taken)
    elif kind == COMPUTED:
        right = predict_target(targets, predictor[3], predictor[4], row, target)
    if kind != CONDITIONAL or taken:
        record_taken(predictor, histories, row, target)
    return right


_ARGUMENTS = (
    "int64[::1]", "int8[::1]", "int64[::1]", "int64[:,::1]", "float64[:,::1]", "float64[::1]", "float64[::1]",
    "float64[::1]", "float64[:,::1]", "int64[::1]", "int64[:,::1]", "int64[::1]", "float64[::1]", "float64",
    "float64[::1]", "float64[::1]", "float64[:,::1]",
    "float64[::1]", "int64[::1]", "float64[:,:,::1]", "float64[::1]", "int64[:,::1]", "float64[:,::1]",
    "int64[:,:,::1]", "int64[::1]", "int64[:,:,::1]", "int64[::1]", "int64[:,::1]", "int64[::1]",
)  # fmt: skip
"""Types of the arguments of ``execute_blocks``: those of ``run``, its results, and its working memory."""


def _compose(digest: str) -> Callable[..., int]:
    def execute_blocks(
        blocks: Array, taken: Array, first: Array, table: Array, operations: Array, capacity: Array,
        core: Array, slots: Array, library: Array, histories: Array, misses: Array, addresses: Array,
        levels: Array, line: float, cost: Array, stalled: Array, queues: Array,
        ready: Array, version: Array, used: Array, leaves: Array, stored_key: Array, stored: Array,
        targets: Array, base: Array, tagged: Array, record: Array, folds: Array, position: Array,
    ) -> int:  # fmt: skip
        predictor = (base, tagged, record, folds, position)
        count = len(blocks)
        window = len(leaves)
        enters, resumes, retired, clock, number, entry, changes = 0.0, 0.0, 0.0, 0.0, 0, 0, 0
        next_miss, free, begins = 0, 0.0, 0.0
        for step in range(count):
            block = blocks[step]
            stalled[step] = max(0.0, resumes - clock)
            enters = max(enters, resumes)
            for row in range(first[block], first[block + 1]):
                one = table[row]
                enters = max(enters + slots[row] / core[WIDTH], leaves[entry % window])
                if one[KIND] == LIBRARY:
                    done = max(enters, ready[0], ready[1]) + library[row, 1]
                    enters += library[row, 0]
                    ready[0] = ready[1] = done
                else:
                    enters = max(enters, _queued_until(queues, operations, one))
                    at = _available(one[FIRST_ADDRESS:FIRST_WRITE], ready, enters)
                    done = _available(one[FIRST_READ:FIRST_ADDRESS], ready, enters)
                    place, where = IN_TRACE, addresses[number]
                    if where < 0:
                        place = _address(one, version) if one[PLACE] != 0 else np.int64(0)
                        where = one[DISPLACEMENT]
                    last_miss = _end_of_misses(misses, next_miss, step, row)
                    if one[LOAD] >= 0:
                        operation = operations[one[LOAD]]
                        starts = _load(used, capacity, operation, at, one[LOADS])
                        _occupy(queues, operation, starts)
                        arrives, free = _fetch_lines(misses, next_miss, last_miss, levels, line, at, free)
                        done = max(done, starts + operation[LATENCY], arrives)
                        if place != 0:
                            forwarded = _forward(
                                stored_key, stored, place, where, one[SIZE], at, core[FORWARD]
                            )
                            done = max(done, forwarded)
                    else:
                        free = _send_lines(misses, next_miss, last_miss, levels, line, at, free)
                    next_miss = last_miss
                    if one[OPERATION] >= 0:
                        operation = operations[one[OPERATION]]
                        starts = _issue(used, capacity, operation, done, float(one[TIMES]))
                        _occupy(queues, operation, starts)
                        done = starts + operation[LATENCY]
                    if one[STORE] >= 0:
                        starts = _issue(used, capacity, operations[one[STORE]], at, 1.0)
                        _occupy(queues, operations[one[STORE]], starts)
                        done = max(done, starts)
                        if place != 0:
                            leave = max(done, retired)
                            _record_store(stored_key, stored, place, where, one[SIZE], number, done, leave)
                    changes = _write_registers(one[FIRST_WRITE:FIRST_BUMP], ready, version, done, changes)
                    changes = _write_registers(one[FIRST_BUMP:COLUMNS], ready, version, at + 1.0, changes)
                retired = max(retired, done)
                inside = 1
                if one[KIND] == LIBRARY:
                    inside = max(1, min(window, int(IN_A_CALL * core[WIDTH] * library[row, 0])))
                for _ in range(inside):
                    leaves[entry % window] = retired
                    entry += 1
                number += 1
                if one[KIND] == PLAIN or one[KIND] == LIBRARY or step + 1 == count:
                    continue
                target = blocks[step + 1]
                if one[KIND] != CONDITIONAL or taken[step] == 1:
                    other = one[KIND] == COMPUTED and _entry(targets, folds, row, -1)[TARGET] != target
                    enters = begins = max(enters, begins + (core[JUMPS] if other else 1.0))
                if not _predict(predictor, histories, targets, one[KIND], row, taken[step] == 1, target):
                    resumes = done + core[REFILL]
            finished = max(retired, enters)
            cost[step] = finished - clock
            clock = finished
        return 1 if digest else 0

    return execute_blocks


def _empty_queues(entries: Array) -> Array:
    """Return the heaps of the issue queues, rows of one length."""
    queues = np.full((len(entries), max(entries, default=1)), np.inf)
    for queue, size in enumerate(entries):
        queues[queue, :size] = 0.0
    return queues


def _empty_targets(tables: int) -> Array:
    entries = np.full((tables + 1, TARGETS, 3), -1, dtype=np.int64)
    entries[:, :, CONFIDENCE] = 0
    return entries


def _base_counters(blocks: Array, taken: Array, first: Array, table: Array) -> Array:
    """Return the counters of branches for the direction that each takes more often in a run."""
    rows = first[blocks + 1] - 1
    branches = table[rows, KIND] == CONDITIONAL
    places = rows[branches] % TABLE_SIZE
    balance = np.bincount(places, weights=2.0 * taken[branches] - 1.0, minlength=TABLE_SIZE)
    return np.where(balance > 0.0, 1, np.where(balance < 0.0, -2, 0))


execute_blocks = NumericCode("execute_blocks", _compose, (Path(__file__),), _ARGUMENTS)


def run(
    blocks: Array, taken: Array, first: Array, table: Array, operations: Array, capacity: Array, core: Array,
    slots: Array, library: Array, histories: Array, misses: Array, addresses: Array, levels: Array,
    line: float, entries: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Execute machine blocks.

    Args:
        blocks: Numbers of the machine blocks in the order of execution.
        taken: Whether the branch of each was taken.
        first: First row of each machine block in ``table``, and one more.
        table: Instructions.
        operations: Classes of operations.
        capacity: Capacity of the pipes per cycle.
        core: Width, window, refill, forwarding and computed jumps.
        slots: Slots of the front end by row.
        library: Cycles and latency of a library call by row.
        histories: Lengths of the branch predictor's histories.
        misses: Accesses that the first cache does not serve, in order.
        addresses: Address of each instruction that runs, -1 where it is not known.
        levels: Latency of each level, cycles.
        line: Cycles in which memory delivers a line, 0 where it is a level like the others.
        entries: Entries of each issue queue.

    Returns:
        Cycles from the end of the block before to the end of each block, and how many of them nothing entered
        because the branch before was mispredicted.
    """
    cost, stalled = np.zeros(len(blocks)), np.zeros(len(blocks))
    stated = (
        blocks,
        taken,
        first,
        table,
        operations,
        capacity,
        core,
        slots,
        library,
        histories,
        misses,
        addresses,
        levels,
    )
    arrays = [
        np.ascontiguousarray(value, dtype=declared.partition("[")[0])
        for declared, value in zip(_ARGUMENTS, stated, strict=False)
    ]
    execute_blocks.bind(
        *arrays, line, cost, stalled, _empty_queues(entries),
        np.zeros(REGISTERS), np.zeros(REGISTERS, dtype=np.int64),
        np.full((len(capacity), SLOT_CYCLES, 2), -1.0),
        np.zeros(int(core[WINDOW])),
        np.zeros((PLACES, 2), dtype=np.int64), np.zeros((PLACES, 2)), _empty_targets(len(histories)),
        *new_predictor(len(histories), _base_counters(*arrays[:4])),
    )()  # fmt: skip
    return cost, stalled
