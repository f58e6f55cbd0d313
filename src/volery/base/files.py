"""Files of a user: regular ones only are read, and none is written through a symbolic link.

A run folder or a model may come from another person. A link in it must not let a run overwrite another file,
and a FIFO or a device in it must not let a command wait or read for ever.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

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


def read_text(path: Path) -> str:
    """Return the text of a regular file in UTF-8.

    Raises:
        OSError: The file cannot be read, is no regular file, or is larger than ``MAX_TEXT``.
        UnicodeDecodeError: It is not UTF-8.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(descriptor, "rb") as file:
        _check_regular(descriptor, path)
        data = file.read(MAX_TEXT + 1)
    if len(data) > MAX_TEXT:
        raise OSError(errno.EFBIG, f"it is larger than {MAX_TEXT} bytes", str(path))
    return data.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")


def _check_regular(descriptor: int, path: Path) -> None:
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is no regular file", str(path))
