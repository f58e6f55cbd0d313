"""For components: sources become one object that counts its blocks, and what each block costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from volery.cost.core import CoreLaw
from volery.cost.native.costs import Costs, static_costs
from volery.cost.native.program import compile_program
from volery.cost.native.store import kept_costs


@dataclass(frozen=True)
class Instrumented:
    """An object that exports ``uint64_t volery_counters[]`` and ``volery_counters_length``; costs by counter.

    ``functions`` are the symbols of the functions that the counters are in; ``key`` is the program's.
    ``estimated`` says what a report has to say, empty where the costs come from a trace of this very code.
    """

    object_file: Path
    costs: Costs
    law: CoreLaw
    functions: tuple[str, ...]
    key: str
    estimated: str = ""


def instrument(sources: Sequence[Path], law: CoreLaw, out: Path, flags: Sequence[str] = ()) -> Instrumented:
    """Compile *sources* for the core of *law*, write the counting object for this machine to *out*.

    Costs are those kept from an earlier trace of the same code, or else from the code alone, which
    ``estimated`` says. ``cycles`` of a stretch are ``costs.total(counters_after - counters_before)``.
    ``CompilerError`` has the compiler's words, ``UsageError`` says which package brings LLVM.
    """
    program = compile_program(sources, law, flags)
    program.counted_object(out)
    functions = tuple(block.function for block in program.blocks)
    kept = kept_costs(program.key)
    if kept is not None:
        return Instrumented(out, kept, law, functions, program.key)
    names = ", ".join(source.name for source in sources)
    said = f"the cost of {names} on {law.name} comes from its code alone; calibrate components learns it"
    return Instrumented(out, static_costs(program), law, functions, program.key, said)
