"""``simulate``: a model in virtual time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

from volery.base.garbage import seldom_collected
from volery.model.builder import ModelBuilder
from volery.model.system import System
from volery.run.result import DEFAULT_OPTIONS, Options, Run
from volery.run.run_session import GraphSession, RunSession, check_fidelity, read_system
from volery.run.supervision import recover_run, run_supervised, supervision_of


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
    return _simulated(system, options) if options.graph else _supervised(system, options)


def _simulated(system: System, options: Options) -> Run:
    """Run in this process."""
    session = (GraphSession if options.graph else RunSession)(system, options)
    try:
        return session.run()
    finally:
        session.leave()


def _supervised(system: System, options: Options) -> Run:
    """Run in a child process if there are C++ components, which may crash it."""
    supervision = supervision_of(system, options)
    if supervision is None:
        return _simulated(system, options)
    return run_supervised(
        lambda show, tell: _simulated(system, replace(options, show=show, tell=tell)),
        options.show,
        options.tell,
        supervision,
        partial(recover_run, system, options, 0),
    )
