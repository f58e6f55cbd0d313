"""Stand-ins for modules of Python whose meaning depends on the run: time, chance, threads and queues.

They are imported in place of the real ones by the files of components, and by nothing else. With them plain
Python that sleeps, waits and draws runs in virtual time and repeats itself with the seed. What they do not
offer says so.
"""

from __future__ import annotations

from types import ModuleType

from volery.base.time import Ns, S
from volery.components.virtual_stdlib import environment, synchronization
from volery.components.virtual_stdlib.module import make_module
from volery.kernel.api import Kernel

EPOCH: Ns = 1_700_000_000 * S
"""What ``time.time()`` says at the start of a run in virtual time: 2023-11-14 22:13:20 UTC."""


REFUSED = ("asyncio", "concurrent.futures", "multiprocessing", "sched", "selectors", "signal")
"""They wait for the machine's clock or its events, which a run does not pass with: nothing is offered of
them.
"""


def virtual_modules(kernel: Kernel, seed: int, epoch: Ns = EPOCH) -> dict[str, ModuleType]:
    """By name, for ``Loader``. *epoch*: ``time.time_ns()`` at the start of the run."""
    refused = {name: make_module(name, {}) for name in REFUSED}
    return {
        **refused,
        "builtins": environment.builtins_module(kernel),
        "time": environment.time_module(kernel, epoch),
        "datetime": environment.datetime_module(kernel, epoch),
        "random": environment.random_module(kernel, seed),
        "queue": synchronization.queue_module(kernel),
        "threading": synchronization.threading_module(kernel),
    }
