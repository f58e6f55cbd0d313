"""A file that is written until it is done or the disk is full, and never ends in half a record."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from volery.base.errors import UsageError


class Output:
    """A file that takes whole records only. What it has taken survives the death of this process.

    Raises ``UsageError`` if it cannot be made. Should it become unwritable later (a full disk), it is cut
    back to its last whole record, takes nothing more and says so in ``problem``; a run need not end for it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = 0
        self.problem = ""
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise UsageError(f"cannot write {path}: {error.strerror or error}") from error

    @property
    def closed(self) -> bool:
        """True once it takes nothing more because it was closed."""
        return self._file.closed

    def write(self, record: bytes) -> bool:
        """Hand *record* to the operating system; False if it was not taken."""
        if self.problem or self._file.closed:
            return False
        rest = memoryview(record)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self._give_up(error)
            return False
        self.size += len(record)
        return True

    def _give_up(self, error: OSError) -> None:
        why = error.strerror or error
        self.problem = f"cannot write {self.path} any more: {why}; it ends after {self.size} bytes"
        with suppress(OSError):  # readers of both formats cope with a file that is cut anywhere
            self._file.truncate(self.size)

    def close(self) -> None:
        """Let go of the file. A second call does nothing."""
        with suppress(OSError):  # what could not be written was reported when it happened
            self._file.close()
