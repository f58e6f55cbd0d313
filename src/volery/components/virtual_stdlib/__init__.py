"""Replacements of modules of Python that depend on the run: clocks, random numbers, threads and queues.

The files of components import them in place of the real ones. With them plain Python that sleeps, waits and
draws runs in virtual time and is reproducible with the seed. A name that a replacement lacks raises an error
that says so.
"""

from __future__ import annotations

from types import ModuleType

from volery.base.time import Ns, S
from volery.components.virtual_stdlib import (
    concurrency,
    process_environment,
    process_modules,
    synchronization,
)
from volery.components.virtual_stdlib.process_environment import make_module
from volery.kernel.api import Kernel

EPOCH: Ns = 1_700_000_000 * S
"""``time.time_ns()`` at the start of a run in virtual time: 2023-11-14 22:13:20 UTC."""

PROCESSES = ("Array", "Event", "Lock", "Manager", "Pipe", "Pool", "Process", "Queue", "Value")
"""Names of ``multiprocessing``, which libraries mention: they are refused when they are used."""

REFUSED = ("sched", "selectors", "signal")
"""Modules that wait for the machine's clock or its events; their replacements have no names."""


def virtual_modules(kernel: Kernel, seed: int, epoch: Ns = EPOCH) -> dict[str, ModuleType]:
    """Return the replacements by name, for ``Loader``.

    Args:
        kernel: The run's kernel.
        seed: The run's seed.
        epoch: ``time.time_ns()`` at the start of the run.
    """
    refused = {name: make_module(name, {}) for name in REFUSED}
    return {
        **refused,
        **concurrency.asyncio_modules(kernel),
        "concurrent.futures": concurrency.futures_module(kernel),
        "multiprocessing": make_module(
            "multiprocessing", {name: type(name, (process_modules.RefusedProcess,), {}) for name in PROCESSES}
        ),
        "builtins": process_environment.builtins_module(kernel),
        "time": process_environment.time_module(kernel, epoch),
        "datetime": process_environment.datetime_module(kernel, epoch),
        "random": process_environment.random_module(kernel, seed),
        "queue": synchronization.queue_module(kernel),
        "threading": synchronization.threading_module(kernel),
    }
