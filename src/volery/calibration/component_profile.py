"""What C++ components cost, learnt from a run of theirs.

The blocks that they enter in a run go through the model of their core. What comes out is kept with the code
and prices it in every later run at fidelity ``code``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from volery.base.errors import UsageError
from volery.cost.native.block_costs import save_costs, traced_costs
from volery.cost.native.instrumented_run import BlockTrace, read_trace
from volery.model.system import System
from volery.run.assembly.cpp import CompiledInstance, TracingCompiler, compile_all
from volery.run.result import Options, Run
from volery.run.simulate import simulate

MAX_BLOCKS = 400_000
"""Blocks that are followed of one kind of component."""


@dataclass(frozen=True)
class ComponentProfile:
    """What was learnt of one component's code on one core.

    ``met`` of its ``blocks`` were entered, those whose cost is known from now on; ``followed`` of ``entered``
    entries were found again in the core's machine code.
    """

    component: str
    instances: tuple[str, ...]
    core: str
    blocks: int
    met: int
    entered: int
    followed: float


def profile_components(system: System, options: Options) -> tuple[tuple[ComponentProfile, ...], Run]:
    """Run *system* once and keep what its C++ components cost.

    Raises ``UsageError`` if there is none on a core that is known; what ``simulate`` raises.
    """
    with TemporaryDirectory(prefix="volery-traces-") as made:
        folder = Path(made)
        ready = compile_all(system, system.instances, "code", options.tell, traced=True)
        traced = {name: one for name, one in ready.items() if one.tracing is not None}
        if not traced:
            what = "no component of it is C++ on a processor whose core is known"
            raise UsageError(f"{system.name}: {what}, so there is nothing to learn")
        run = simulate(system, replace(options, fidelity="code", traces=folder))
        return tuple(_learn(folder, kinds) for kinds in _kinds(system, traced)), run


def _kinds(
    system: System, traced: dict[str, CompiledInstance]
) -> Iterable[dict[str, tuple[str, TracingCompiler]]]:
    """Instances by what was compiled: each has the name of its component."""
    components = {instance.name: instance.component.name for instance in system.instances}
    kinds: dict[str, dict[str, tuple[str, TracingCompiler]]] = {}
    for name, one in traced.items():
        assert one.tracing is not None
        assert one.tracing.program is not None
        kinds.setdefault(one.tracing.program.key, {})[name] = components[name], one.tracing
    return kinds.values()


def _learn(folder: Path, kind: dict[str, tuple[str, TracingCompiler]]) -> ComponentProfile:
    component, tracing = next(iter(kind.values()))
    program = tracing.program
    assert program is not None
    whole = BlockTrace([])
    for name in kind:
        file = folder / name
        whole = whole.then(read_trace(file)) if file.exists() else whole
    whole = whole.until(MAX_BLOCKS)
    costs, walked = traced_costs(program, whole)
    save_costs(program.key, costs)
    entered = len(whole.blocks)
    followed = 1.0 - walked.lost / entered if entered else 0.0
    met = int(np.count_nonzero(costs.seen))
    return ComponentProfile(
        component, tuple(kind), tracing.law.name, len(program.blocks), met, entered, followed
    )
