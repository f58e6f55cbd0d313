"""Profile of C++ components: the cost of their basic blocks, from one traced run of a model.

The blocks that a component enters in the run pass through the model of its core. The costs are kept with the
code and price it in every later run at fidelity ``code``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from volery.base.errors import UsageError
from volery.cost.native import BlockTrace, read_trace, save_costs, traced_costs
from volery.model.system import System
from volery.run.assembly.cpp import TracingCompiler, compile_all
from volery.run.result import Options, Run
from volery.run.simulate import simulate

MAX_BLOCKS = 400_000
"""Blocks that are followed of one type of component."""


@dataclass(frozen=True)
class ComponentProfile:
    """Result for one component's code on one core.

    Attributes:
        component: Name of the component.
        instances: Names of its instances.
        core: Name of the core.
        blocks: Basic blocks of the code.
        met: Blocks that were entered, whose cost is known from now on.
        entered: Entries that were traced.
        followed: Share of the entries that were found in the core's machine code.
    """

    component: str
    instances: tuple[str, ...]
    core: str
    blocks: int
    met: int
    entered: int
    followed: float


def profile_components(system: System, options: Options) -> tuple[tuple[ComponentProfile, ...], Run]:
    """Run a system once and keep the costs of its C++ components.

    Raises:
        UsageError: No component is C++ on a processor whose core is known.
    """
    with TemporaryDirectory(prefix="volery-traces-") as made:
        folder = Path(made)
        ready = compile_all(system, system.instances, "code", options.tell, traced=True)
        compiled: dict[str, dict[str, TracingCompiler]] = {}  # by the program's key and the instance
        for name, one in ready.items():
            if one.tracing is not None and one.tracing.program is not None:
                compiled.setdefault(one.tracing.program.key, {})[name] = one.tracing
        if not compiled:
            what = "no component of it is C++ on a processor whose core is known"
            raise UsageError(f"{system.name}: {what}, so there is nothing to profile")
        run = simulate(system, replace(options, fidelity="code", traces=folder))
        components = {instance.name: instance.component.name for instance in system.instances}
        profiles = tuple(
            _profile(folder, components[next(iter(instances))], instances) for instances in compiled.values()
        )
        return profiles, run


def _profile(folder: Path, component: str, instances: dict[str, TracingCompiler]) -> ComponentProfile:
    """Keep the costs of the code that ``instances`` share, from all their traces."""
    tracing = next(iter(instances.values()))
    program = tracing.program
    assert program is not None
    trace = BlockTrace([])
    for name in instances:
        file = folder / name
        trace = trace.then(read_trace(file)) if file.exists() else trace
    trace = trace.until(MAX_BLOCKS)
    costs, path, _ = traced_costs(program, trace)
    save_costs(program.key, costs)
    entered = len(trace.blocks)
    return ComponentProfile(
        component=component,
        instances=tuple(instances),
        core=tracing.law.name,
        blocks=len(program.blocks),
        met=int(np.count_nonzero(costs.seen)),
        entered=entered,
        followed=1.0 - path.lost / entered if entered else 0.0,
    )
