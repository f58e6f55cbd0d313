"""``simulate``: a model in virtual time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

from volery.base.garbage import seldom_collected
from volery.components.cpp.build import build_framework
from volery.model.builder import ModelBuilder
from volery.model.system import System
from volery.run.assembly.cpp import compile_all, has_cpp
from volery.run.result import DEFAULT_OPTIONS, Options, Run
from volery.run.run_session import PATIENCE_S, GraphSession, RunSession, check_fidelity, read_system
from volery.run.supervision import Supervision, recover_run, run_supervised


@seldom_collected()
def simulate(
    model: System | ModelBuilder | str | Path,
    options: Options = DEFAULT_OPTIONS,
    *,
    scenario: str | None = None,
    allocation: str | None = None,
    overrides: Iterable[str] = (),
) -> Run:
    """Simulate a model in virtual time and return its record.

    The same model, options and seed give the same trace, byte for byte.

    Args:
        model: A file, a folder with a ``model.yaml``, a ``ModelBuilder``, or a ``System``.
        options: Fidelity, seed, pace, run folder and progress reports.
        scenario: Scenario of a model that is read from a file.
        allocation: Allocation of a model that is read from a file; None for its first.
        overrides: Changes ``path=value`` of a model that is read from a file.

    Returns:
        The run. An error during the simulation is its ``error`` and is not raised.

    Raises:
        ModelError: The model is wrong; nothing has started.
        UsageError: An option is wrong; nothing has started.
    """
    check_fidelity(options.fidelity)
    system = read_system(model, scenario, allocation, overrides)
    if has_cpp(system) and not options.graph:
        return _supervised(system, options)
    return _simulated(system, options)


def _simulated(system: System, options: Options) -> Run:
    """Run in this process."""
    session = (GraphSession if options.graph else RunSession)(system, options)
    try:
        return session.run()
    finally:
        session.leave()


def _supervised(system: System, options: Options) -> Run:
    """Run in a child process, which a C++ component may crash."""
    traced = options.traces is not None
    ready = compile_all(system, system.instances, options.fidelity, options.tell, traced=traced)
    if not ready:
        return _simulated(system, options)
    libraries = {name: one.compiled.library for name, one in ready.items()}
    supervision = Supervision(build_framework(), libraries, PATIENCE_S)
    return run_supervised(
        lambda show, tell: _simulated(system, replace(options, show=show, tell=tell)),
        options.show,
        options.tell,
        supervision,
        partial(recover_run, system, options.folder, options.seed, options.fidelity),
    )
