"""Native simulation: what compiled code costs on a core, from one run of it on this machine.

The sources become LLVM's intermediate code, optimised for the target. The target's machine code for it is run
through a model of its core once, along a trace of blocks, which gives each block its mean cost. From then on
code runs at the speed of this machine with one counter per block: cost = counts . costs.

Imports ``cost`` and ``base``. It must not know components, the kernel or models: it turns sources and a core
into costs.
"""

from volery.cost.native.block_costs import BlockCosts, Instrumented, instrument, static_costs, traced_costs
from volery.cost.native.compilation import CompilerError, Program, compile_program

__all__ = [
    "CompilerError",
    "BlockCosts",
    "Instrumented",
    "Program",
    "compile_program",
    "instrument",
    "static_costs",
    "traced_costs",
]
