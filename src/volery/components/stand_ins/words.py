"""``print``: what a component prints becomes a line of the trace, and goes to the standard error stream.

The standard output belongs to the program that runs the components.
"""

from __future__ import annotations

import builtins as real_builtins
import sys
from io import StringIO
from types import ModuleType
from typing import Any

from volery.kernel.api import Kernel
from volery.trace.events import Text

INFO = 6
"""Severity, as in syslog."""


def builtins_module(kernel: Kernel) -> ModuleType:
    """Stands in for ``builtins``, and for the names that are there without an import."""

    def say(
        *values: Any, sep: str | None = " ", end: str | None = "\n", file: Any = None, flush: bool = False
    ) -> None:
        if file is not None:
            real_builtins.print(*values, sep=sep, end=end, file=file, flush=flush)
            return
        written = StringIO()
        real_builtins.print(*values, sep=sep, end=end, file=written)
        text = written.getvalue()
        sys.stderr.write(text)
        with kernel:
            task = kernel.current()
            if task is not None and text.strip():
                kernel.record(Text(kernel.now(), task.place.component, INFO, text.rstrip()))

    module = ModuleType("builtins", real_builtins.__doc__)
    module.__dict__.update(vars(real_builtins), print=say)
    return module
