"""Cost of compiled code on another core, from one run of the code on this machine.

The sources become LLVM's intermediate code, optimised for the target. The target's machine code for it runs
once through a model of the core along a recorded sequence of basic blocks, which gives each block its mean
cost. From then on the code runs at the speed of this machine with one counter per block, and the cost of a
run is the scalar product of counts and costs.

Compiled code is counted, not emulated: an instruction-set simulator is a hundred times slower. llvm-mca knows
neither caches nor branch prediction, and its schedules cover one block only.

This package may import ``cost`` and ``base`` only. Other packages import from here, not from the modules.
"""

from volery.cost.native.block_costs import (
    BlockCosts,
    Instrumented,
    block_steps,
    instrument,
    load_costs,
    save_costs,
    static_costs,
    traced_costs,
)
from volery.cost.native.compilation import (
    METHOD,
    CompilerError,
    OptimisedCode,
    compile_program,
    llvm_toolchain,
    run_tool,
)
from volery.cost.native.instrumented_run import (
    BlockTrace,
    Invocation,
    cache_settings,
    read_trace,
    runtime_objects,
)
from volery.cost.native.program_estimate import ProgramEstimate, SourceLineCost, estimate_program

__all__ = [
    "METHOD",
    "BlockCosts",
    "BlockTrace",
    "CompilerError",
    "Instrumented",
    "Invocation",
    "OptimisedCode",
    "ProgramEstimate",
    "SourceLineCost",
    "block_steps",
    "cache_settings",
    "compile_program",
    "estimate_program",
    "instrument",
    "llvm_toolchain",
    "load_costs",
    "read_trace",
    "run_tool",
    "runtime_objects",
    "save_costs",
    "static_costs",
    "traced_costs",
]
