"""Ctrl-C while something is compiled.

The compiler calls back into Python from code that can raise nothing, so a ``KeyboardInterrupt`` that strikes
there is reported as unraisable and lost. It is sent again a moment later.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

AGAIN_AFTER_S = 0.05
"""Wall seconds: long enough for the callback to be over."""


@contextmanager
def insisted_on() -> Iterator[None]:
    """For as long as the context lasts, a Ctrl-C that got lost comes again."""
    before = sys.unraisablehook

    def hook(lost: UnraisableHookArgs) -> None:
        if lost.exc_type is KeyboardInterrupt:
            main = threading.main_thread().ident or 0
            threading.Timer(AGAIN_AFTER_S, signal.pthread_kill, (main, signal.SIGINT)).start()
        else:
            before(lost)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before
