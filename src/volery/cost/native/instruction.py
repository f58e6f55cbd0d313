"""What an instruction does to a processor: which operations it takes, what it reads, writes and remembers."""

from __future__ import annotations

from dataclasses import dataclass

OPERATIONS = (
    "alu", "move", "increment", "shift", "shifted_alu", "multiply", "divide32", "divide64",
    "load", "load_vector", "store", "branch",
    "fp_add", "fp_compare", "fp_multiply", "fp_fma", "fp_divide32", "fp_divide64", "fp_root32", "fp_root64",
    "convert", "transfer", "vector", "vector_move", "vector_multiply", "shuffle",
)  # fmt: skip
"""The classes of operations that a core has figures for (``volery.cost.core``)."""


@dataclass(frozen=True)
class Memory:
    """What an instruction loads from or stores to, as far as its text tells.

    The ``registers`` of the address; ``place`` is its text without the ``displacement``, empty where it says
    nothing; ``size`` in bytes.
    """

    registers: tuple[str, ...] = ()
    place: str = ""
    displacement: int = 0
    size: int = 8


NOWHERE = Memory()


@dataclass(frozen=True)
class Effect:
    """An instruction, for a core model.

    ``slots`` of the front end; ``loads`` loads of the class ``load`` before the ``operation`` (``times`` of
    it), and a store after it; registers by one name each: ``reads`` for the operation, ``writes`` when it is
    done, ``bumps`` an address register at once.
    """

    slots: float = 1.0
    load: str = ""
    loads: int = 1
    operation: str = ""
    times: int = 1
    store: bool = False
    memory: Memory = NOWHERE
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    bumps: tuple[str, ...] = ()
