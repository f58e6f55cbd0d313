"""The files on board of an autopilot: list and download, by MAVLink FTP."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from volery.base.errors import Refused, UsageError
from volery.vehicles.services import FileEntry, FileSystem

Show = Callable[[int, int], object]


class OnboardFiles:
    """Files of one autopilot, read only.

    Args:
        vehicle: name of the vehicle.
        system: its file system.
    """

    def __init__(self, vehicle: str, system: FileSystem) -> None:
        self._name = vehicle
        self._system = system

    def list(self, folder: str = "/") -> list[FileEntry]:
        """Return the files and folders in *folder*, folders first, by name."""
        found = self._system.list(folder)
        return sorted(found, key=lambda entry: (not entry.is_folder, entry.name))

    def download(self, path: str, file: str | Path, show: Show | None = None) -> Path:
        """Download a file into another, which may not exist.

        What has arrived is kept if the transfer ends early, and the next call goes on from there.

        Args:
            path: path on board, such as ``/log/2026-01-01/00_00_12.ulg`` of a PX4 or
                ``/logs/00000001.BIN`` of an ArduPilot.
            file: path of the file to write.
            show: called with the bytes that have arrived and the size of the file. It must not block.

        Returns:
            The path of the file.
        """
        check_absent(file)
        self._system.reset()
        size = self._system.open(path)
        try:
            return write_parts(file, size, lambda have: self._read(path, have, size), show)
        finally:
            self._system.close()

    def _read(self, path: str, have: int, size: int) -> bytes:
        data = self._system.read(path, have)
        if not data:
            raise Refused(self._name, f"read {path}", f"it ends at byte {have} of {size}")
        return data


def check_absent(file: str | Path) -> None:
    """Raise ``UsageError`` if there is a file of that name."""
    if Path(file).exists():
        raise UsageError(f"{file} exists; choose another name")


OVERLAP = 64
"""Bytes that are read again, to find out whether an earlier transfer was of the same file."""


def _is_beginning(stream: BinaryIO, have: int, size: int, read: Callable[[int], bytes]) -> bool:
    """Return whether the last of *have* bytes of *stream* are those of the file that *read* reads."""
    if have > size:
        return False
    start = max(0, have - OVERLAP)
    stream.seek(start)
    return read(start)[: have - start] == stream.read()


def write_parts(file: str | Path, size: int, read: Callable[[int], bytes], show: Show | None) -> Path:
    """Write what *read* returns from each place on, and go on where an earlier call for it was ended.

    Args:
        file: path of the file, which may not exist; until it is whole it ends in ``.part``.
        size: bytes in all.
        read: takes the bytes that there are, and returns those after them.
        show: called with the bytes that there are and the size.

    Returns:
        The path of the file.
    """
    check_absent(file)
    path, part = Path(file), Path(f"{file}.part")
    try:
        with part.open("a+b") as stream:
            have = stream.seek(0, os.SEEK_END)
            if have and not _is_beginning(stream, have, size, read):  # of another file
                have = 0
                stream.truncate(0)
            while have < size:
                data = read(have)[: size - have]
                stream.write(data)
                stream.flush()
                have += len(data)
                if show is not None:
                    show(have, size)
        part.rename(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
    return path
