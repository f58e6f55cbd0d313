"""The end of a connection: at the end of ``with``, by ``close()``, or when the program ends.

A vehicle or a fleet is a session. The function that opens it states what its end consists of.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from types import TracebackType
from typing import Self


class Session:
    """What is open until it is closed, once.

    ```python
    drone = volery.connect("sim:px4")  # a notebook, a REPL: closed when Python exits
    drone.takeoff(10)
    drone.close()

    with volery.connect("sim:px4") as drone:  # closed at the end of the block
        drone.takeoff(10)
    ```

    Args:
        end: ends it.
    """

    def __init__(self, end: Callable[[], object]) -> None:
        self.at_end = ExitStack()
        """What is left to do at the end, last entry first."""
        self.at_end.callback(end)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> bool | None:
        return self.at_end.__exit__(kind, error, traceback)

    def close(self) -> None:
        """End the connection, as the end of ``with`` does; once closed, do nothing.

        A vehicle of ``connect`` comes to rest before: it lands, unless an operator has taken it over.
        """
        self.at_end.close()
