"""From a trace of blocks to the machine code that ran: which pieces, in which order, for which block.

The trace says which blocks of the intermediate code were entered. The walk follows the machine code's own
jumps and calls and chooses, where there is a choice, the way on which the next block of the trace comes
first; where several lead there, the values that switches used decide. So what the code generator merged,
split, duplicated or moved is found where it went.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from volery.cost.native.assembly import End, MachineBlock
from volery.cost.native.instrumented_run import Access, BlockTrace
from volery.cost.native.llvm_ir import BasicBlock
from volery.cost.native.switch_resolution import SwitchResolver

_LOOK_AHEAD = 6
"""Records of the trace that a way may skip: blocks whose code was duplicated into the one before."""
_DEPTH = 24
_LOST = 99
_FOREIGN = 30
"""For a block that the trace does not have: the code generator has merged equal ends of blocks."""


@dataclass
class ExecutedPath:
    """What ran: pieces, the block each is charged to, the block that a wait before it is charged to (that of
    the way by which it was reached), whether its branch was taken, the place of its block in the trace that
    was followed; ``lost`` jumps, and ``accesses`` by the same place.
    """

    pieces: list[int] = field(default_factory=list)
    owners: list[int] = field(default_factory=list)
    reached: list[int] = field(default_factory=list)
    taken: list[int] = field(default_factory=list)
    places: list[int] = field(default_factory=list)
    lost: int = 0
    accesses: dict[int, list[Access]] = field(default_factory=dict)


class MachineCode:
    """The pieces of a program, and where its blocks begin in them."""

    def __init__(self, blocks: Sequence[BasicBlock], pieces: Sequence[MachineBlock]) -> None:
        self.pieces = pieces
        self.entry_piece: dict[str, int] = {}
        self.labels: dict[tuple[str, str], int] = {}
        for number, piece in enumerate(pieces):
            self.entry_piece.setdefault(piece.function, number)
            if piece.label:
                self.labels[piece.function, piece.label] = number
        self.blocks = blocks
        self.entries = {block.function: number for number, block in enumerate(blocks) if block.entry}
        self.block_of_piece = self._primaries(blocks)
        self.piece_of_block: dict[int, int] = {}
        for number, block in sorted(self.block_of_piece.items()):
            self.piece_of_block.setdefault(block, number)

    def successors(self, number: int) -> list[int]:
        """The pieces that may follow within the function, what falls through first."""
        piece = self.pieces[number]
        after = [number + 1] if number + 1 < len(self.pieces) else []
        if piece.end in (End.FALLS, End.CALL):
            return after
        if piece.end in (End.BRANCH, End.JUMP):
            there = self.labels.get((piece.function, piece.target))
            onward = [there] if there is not None else []
            return [*after, *onward] if piece.end is End.BRANCH else onward
        return []

    def _primaries(self, blocks: Sequence[BasicBlock]) -> dict[int, int]:
        """The pieces with which blocks begin: those that are entered from elsewhere."""
        known = {(block.function, block.name): number for number, block in enumerate(blocks)}
        entered: dict[int, set[int]] = {}
        for number in range(len(self.pieces)):
            for after in self.successors(number):
                entered.setdefault(after, set()).add(number)
        candidates: dict[int, list[int]] = {}
        for number, piece in enumerate(self.pieces):
            if self.entry_piece[piece.function] == number:
                candidates.setdefault(self.entries[piece.function], []).insert(0, number)
            elif piece.came_from is not None and (starts := number == 0 or self._starts(number)):
                block = known.get((piece.function, piece.came_from))
                if block is not None and starts and not blocks[block].entry:
                    candidates.setdefault(block, []).append(number)
        chosen: dict[int, int] = {}
        for block, numbers in candidates.items():
            outside = [one for one in numbers if self._entered_from_elsewhere(one, entered.get(one, set()))]
            chosen.update(dict.fromkeys(outside or numbers[:1], block))
        return chosen

    def _entered_from_elsewhere(self, number: int, before: set[int]) -> bool:
        came_from = self.pieces[number].came_from
        return not before or any(self.pieces[one].came_from != came_from for one in before)

    def _starts(self, number: int) -> bool:
        """True if the piece begins a labelled block, not what is left of one after a call or branch."""
        before, piece = self.pieces[number - 1], self.pieces[number]
        return bool(piece.label) or before.function != piece.function or before.came_from != piece.came_from


class _PathSearch:
    def __init__(self, machine: MachineCode, trace: BlockTrace, limit: int) -> None:
        self.machine = machine
        followed = trace.only(machine.piece_of_block)
        self.trace, self.values, self.edges = followed.blocks, followed.switches, followed.edges
        self.switch, self.switch_at = SwitchResolver(0), -1
        self.limit = limit
        self.at = self.owner = self.place = 0
        self.edge: int | None = None
        self.out = ExecutedPath(accesses=followed.accesses)
        self.frames: list[tuple[int, int, int]] = []
        self._costs: dict[tuple[int, int, tuple[int, ...]], int] = {}

    def run(self) -> ExecutedPath:
        piece = self._found_again()
        while piece is not None and len(self.out.pieces) < self.limit:
            piece = self._step(piece)
        return self.out

    def _found_again(self) -> int | None:
        """Begin at the next record of the trace, wherever that is."""
        if self.at >= len(self.trace):
            return None
        self._take(1)
        return self.machine.piece_of_block[self.owner]

    def _take(self, count: int) -> None:
        """The next *count* records: what runs now belongs to the last of them."""
        passed = range(self.at, self.at + count)
        self.edge = next((self.edges[place] for place in passed if place in self.edges), None)
        self.at += count
        self.place = self.at - 1
        self.owner = self.trace[self.place]

    def _step(self, number: int) -> int | None:
        piece = self.machine.pieces[number]
        self.out.pieces.append(number)
        self.out.owners.append(self.owner)
        self.out.reached.append(self.owner if self.edge is None else self.edge)
        self.edge = None
        self.out.taken.append(0)
        self.out.places.append(self.place)
        switched = self._switched(piece)
        if piece.end is End.CALL:
            return self._call(number, piece)
        if piece.end is End.RETURN:
            return self._return()
        ways = self.machine.successors(number)
        if not ways and piece.end is End.JUMP:  # a call in the place of a return
            entry = self.machine.entries.get(piece.target)
            return self._found_again() if self._next() == entry and entry is not None else self._return()
        if not ways:
            self.out.taken[-1] = 1
            return self._within(piece.function)
        best = min(ways, key=self._distance)
        if self._distance(best) >= _LOST:
            return self._lost()
        if switched is not None and len(ways) > 1 and self._distance(ways[switched]) < _LOST:
            best = ways[switched]
        self.out.taken[-1] = int(best != number + 1 or piece.end is End.JUMP)
        return self._enter_piece(best)

    def _switched(self, piece: MachineBlock) -> bool | None:
        """Whether the branch of the piece is taken, where it is one of a switch that is under way."""
        value = self.values.get(self.at)
        if value is None:
            return None
        if self.switch_at != self.at:
            self.switch, self.switch_at = SwitchResolver(value), self.at
        return self.switch.taken(piece)

    def _call(self, number: int, piece: MachineBlock) -> int | None:
        blocks = self.machine.blocks
        ahead = self.trace[self.at : self.at + _LOOK_AHEAD]
        skipped = next((place for place, block in enumerate(ahead) if blocks[block].entry), None)
        if skipped is not None and self._calls(piece.target, blocks[ahead[skipped]].function, skipped):
            self.frames.append((number + 1, self.owner, self.place))
            self._take(skipped + 1)
            return self.machine.piece_of_block[self.owner]
        return self._enter_piece(number + 1) if number + 1 < len(self.machine.pieces) else self._return()

    def _calls(self, target: str, function: str, skipped: int) -> bool:
        """Whether this call is of the next function that the trace enters, *skipped* records from here: those
        of blocks whose code was merged into one that has run. Who is called by a computed call follows at
        once.
        """
        return target == function if target else skipped == 0

    def _return(self) -> int | None:
        if not self.frames:
            return self._found_again()
        number, self.owner, self.place = self.frames.pop()
        return self._enter_piece(number)

    def _within(self, function: str) -> int | None:
        """The target of a computed jump: the next record, if it is in this function."""
        coming = self._next()
        if coming is not None and self.machine.blocks[coming].function == function:
            return self._found_again()
        return self._lost()

    def _lost(self) -> int | None:
        """An exception, or a jump out of a library: take up the trace where it goes on."""
        self.out.lost += 1
        coming = self._next()
        if coming is not None:
            function = self.machine.blocks[coming].function
            while self.frames and self.machine.pieces[self.frames[-1][0]].function != function:
                self.frames.pop()
            if self.frames and not self.machine.blocks[coming].entry:
                self.frames.pop()
        return self._found_again()

    def _enter_piece(self, number: int) -> int:
        block = self.machine.block_of_piece.get(number)
        if block is not None:
            ahead = self.trace[self.at : self.at + _LOOK_AHEAD]
            if block in ahead:
                self._take(ahead.index(block) + 1)
        return number

    def _next(self) -> int | None:
        return self.trace[self.at] if self.at < len(self.trace) else None

    def _distance(self, number: int) -> int:
        key = (number, self.owner, tuple(self.trace[self.at : self.at + _LOOK_AHEAD]))
        found = self._costs.get(key)
        if found is None:
            found = self._costs[key] = self._search(number, key[2], _DEPTH)
        return found

    def _search(self, number: int, ahead: tuple[int, ...], depth: int) -> int:
        """How little fits a way by this piece: by records it skips, and by pieces that have none."""
        machine = self.machine
        piece = machine.pieces[number]
        block = machine.block_of_piece.get(number)
        if block is not None and block in ahead:
            return 10 * ahead.index(block)
        if piece.end is End.CALL and piece.target in machine.entries:
            return 0 if ahead and machine.entries[piece.target] == ahead[0] else _LOST
        if piece.end is End.RETURN:
            leaves = not ahead or machine.blocks[ahead[0]].function != piece.function or bool(self.frames)
            return 9 if leaves else _LOST - 1
        ways = machine.successors(number)
        if not ways:
            return 9
        if depth <= 0:
            return _LOST
        foreign = block is not None and block != self.owner
        onward = min(self._search(way, ahead, depth - len(ways) ** 2) for way in ways)
        return min(_LOST, onward + (_FOREIGN if foreign else 1))


def reconstruct_path(machine: MachineCode, trace: BlockTrace, limit: int = 4_000_000) -> ExecutedPath:
    """Follow a trace through the machine code, for at most *limit* pieces."""
    return _PathSearch(machine, trace, limit).run()
