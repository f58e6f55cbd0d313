"""A file of whole records, which stays readable when the disk fills up or the process is killed."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from volery.base.errors import UsageError
from volery.base.files import create_file


class Output:
    """A file of whole records. A record that was written survives the end of this process.

    If the file becomes unwritable later (a full disk), it is truncated to its last whole record, ``problem``
    states the reason, and further records are dropped; the run goes on.

    Raises:
        UsageError: the file cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = 0
        self.problem = ""
        try:
            self._file = create_file(path)
        except OSError as error:
            raise UsageError(f"cannot write {path}: {error.strerror or error}") from error

    @property
    def closed(self) -> bool:
        """True after ``close``."""
        return self._file.closed

    def write(self, record: bytes) -> bool:
        """Write *record* to the operating system; return whether it was written."""
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
        with suppress(OSError):  # both formats can be read from a file that is cut anywhere
            self._file.truncate(self.size)

    def close(self) -> None:
        """Close the file. A second call does nothing."""
        with suppress(OSError):  # what could not be written was reported when it happened
            self._file.close()
