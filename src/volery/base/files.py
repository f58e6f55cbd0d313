"""Files of a user: regular ones only are read, and none is written through a symbolic link.

A run folder or a model may come from another person. A link in it must not let a run overwrite another file,
and a FIFO or a device in it must not let a command wait or read for ever. ``RecordFile`` is a file of whole
records, which stays readable when the disk fills up or the process is killed.
"""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from volery.base.errors import UsageError

MAX_TEXT = 64 << 20
"""Largest text file that is read, bytes."""


def create_file(path: Path) -> BinaryIO:
    """Create *path*, or empty the file there, and return it unbuffered.

    Raises:
        OSError: The file cannot be written, or is a symbolic link or a FIFO.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        descriptor = os.open(path, flags, 0o666)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "it is a symbolic link", str(path)) from None
        raise
    try:
        if not stat.S_ISCHR(os.fstat(descriptor).st_mode):
            _check_regular(descriptor, path)
            os.truncate(descriptor, 0)
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "wb", buffering=0)


def write_text(path: Path, text: str) -> None:
    """Write *text* as UTF-8 into a new or regular file. Raises ``OSError`` as ``create_file`` does."""
    with create_file(path) as file:
        rest = memoryview(text.encode("utf-8"))
        while rest:
            rest = rest[file.write(rest) :]


def replace_text(path: Path, text: str) -> None:
    """Write *text* as UTF-8 in the place of the file *path*, which stays as it is if that fails.

    A device or a pipe is written to. Raises ``OSError`` as ``create_file`` does.
    """
    if path.exists() and not path.is_file():
        path.write_text(text, encoding="utf-8")
        return
    part = path.with_name(f".{path.name}.part")
    try:
        write_text(part, text)
        part.replace(path)
    except OSError:
        with suppress(OSError):
            part.unlink()
        raise


def one_line(text: str) -> str:
    """Return *text* as a line or a comment of a file can hold it: line ends and controls become spaces."""
    return "".join(one if one.isprintable() else " " for one in text)


def read_text(path: Path) -> str:
    """Return the text of a regular file in UTF-8.

    Raises:
        OSError: The file cannot be read, is no regular file, or is larger than ``MAX_TEXT``.
        UnicodeDecodeError: It is not UTF-8.
    """
    data = read_bytes(path, MAX_TEXT)
    return data.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")


def read_bytes(path: Path, most: int) -> bytes:
    """Return the bytes of a regular file.

    Args:
        path: The file.
        most: Largest size that is read, bytes.

    Raises:
        OSError: The file cannot be read, is no regular file, or is larger than *most*.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(descriptor, "rb") as file:
        _check_regular(descriptor, path)
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"it is larger than {most} bytes", str(path))
    return data


def _check_regular(descriptor: int, path: Path) -> None:
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is no regular file", str(path))


class RecordFile:
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
